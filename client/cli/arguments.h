// Words of the command line to values. Every error is INVALID_ARGUMENT, marked
// as the user's (exit code 1), and says what would have been right.
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_ARGUMENTS_H_
#define FATHOM_CLIENT_CLI_ARGUMENTS_H_

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

// "41.6,-71.4": latitude, longitude in degrees, north and east positive.
absl::StatusOr<v1::GeodeticPoint> ParsePoint(std::string_view text);

// A moment: "now"; an offset to now with its unit, "+10min", "-30s", "+1.5h",
// "-2d"; or RFC 3339, "2026-01-01T12:00:00Z". `now` is the clock's.
absl::StatusOr<Time> ParseMoment(std::string_view text, Time now);

// A finite decimal number that takes the whole text.
absl::StatusOr<double> ParseNumber(std::string_view text);

// An area of latitude and longitude, degrees. It crosses the antimeridian if
// west_deg > east_deg.
struct GeoBox {
  double south_deg = 0;
  double west_deg = 0;
  double north_deg = 0;
  double east_deg = 0;

  // Degrees from west to east, in (0, 360].
  double Width() const;
};

// "S,W,N,E" in degrees.
absl::StatusOr<GeoBox> ParseBox(std::string_view text);

// The parts of `text` between `separator`s, spaces at their ends cut off.
std::vector<std::string> SplitList(std::string_view text, char separator);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_ARGUMENTS_H_
