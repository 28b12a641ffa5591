// Which part of the map a verb is about: the flags that choose it, and the
// question to the server that follows. Shared by render and export. Thread
// safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_MAP_AREA_H_
#define FATHOM_CLIENT_CLI_MAP_AREA_H_

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/cli/arguments.h"
#include "client/cli/session.h"
#include "fathom/v1/mission_service.pb.h"
#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

// At most one of the four ways is set; none: the newest activity's area, or
// the whole mission.
struct AreaFlags {
  // "S,W,N,E", degrees.
  std::string area;
  // "LAT,LON" with size_m.
  std::string center;
  double size_m = 0;
  std::string activity_id;
  // A file that fathom-feeder run --json wrote.
  std::string survey;
};

// Adds --area, --center, --size-m, --activity and --survey to a verb. `flags`
// must outlive the parsing.
void AddAreaFlags(CLI::App& verb, AreaFlags& flags);

struct MapArea {
  GeoBox box;
  // When the survey ended, if one chose the area.
  std::optional<Time> time = std::nullopt;
  // Of the activity shown, metres; finer than that shows nothing more. 0:
  // none.
  double cell_m = 0;

  // The longer side, metres.
  double LongerSideM() const;
  // Cells of `resolution_m`, about.
  double Cells(double resolution_m) const;
};

// `margin` of its side is left around an activity or survey. Errors:
// INVALID_ARGUMENT, marked as the user's or the file's; NOT_FOUND (no such
// activity or file).
absl::StatusOr<MapArea> ChooseArea(const AreaFlags& flags, double margin,
                                   const v1::GetMissionStatusResponse& status);

// The question for `area` at this resolution, metres.
v1::GetRegionRequest RegionRequest(const GeoBox& box, double resolution_m);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_MAP_AREA_H_
