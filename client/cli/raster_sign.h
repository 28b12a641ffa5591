// Whether a raster's values are elevations (positive up) or depths (positive
// down). Getting this wrong turns mountains into trenches, so what cannot be
// told is refused, never guessed. No GDAL. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_RASTER_SIGN_H_
#define FATHOM_CLIENT_CLI_RASTER_SIGN_H_

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace fathom::client::cli {

enum class Positive { kAuto, kUp, kDown };

// What the file says of itself.
struct SignEvidence {
  // GDAL's short name.
  std::string driver;
  std::string band_description;
  // Of the band and of its variable: ("positive", "up"), ("long_name", ...).
  std::vector<std::pair<std::string, std::string>> metadata;
  std::string file_name;
  // Of the sample of valid values.
  std::uint64_t values = 0;
  std::uint64_t negative_values = 0;
};

struct SignDecision {
  Positive positive = Positive::kUp;
  // "the band is described as \"elevation\"".
  std::string reason;
};

// In this order: the format's own rule (BAG: up); the attribute `positive`;
// names that say depth or elevation in the standard name, description or long
// name; then the values: at least half below zero are elevations of a sea
// floor. Errors: INVALID_ARGUMENT when none of these tells.
absl::StatusOr<SignDecision> DecideSign(const SignEvidence& evidence);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_SIGN_H_
