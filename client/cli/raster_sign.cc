#include "client/cli/raster_sign.h"

#include <cctype>
#include <string_view>

#include "absl/strings/str_format.h"

namespace fathom::client::cli {
namespace {

std::string Lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(c));
  return text;
}

// Which way a description points; kAuto: it does not say, or says both.
Positive WordsSay(const std::string& description) {
  const std::string text = Lower(description);
  bool up = false;
  bool down = false;
  for (const std::string_view word :
       {"elevation", "altitude", "topograph", "relief", "height", "positive_up",
        "positive up", "topo"}) {
    up = up || text.find(word) != std::string::npos;
  }
  for (const std::string_view word :
       {"depth", "positive_down", "positive down", "sounding"}) {
    down = down || text.find(word) != std::string::npos;
  }
  if (up == down) return Positive::kAuto;
  return up ? Positive::kUp : Positive::kDown;
}

std::string Value(const SignEvidence& evidence, std::string_view key) {
  for (const auto& [name, value] : evidence.metadata) {
    if (Lower(name) == key) return value;
  }
  return "";
}

}  // namespace

absl::StatusOr<SignDecision> DecideSign(const SignEvidence& evidence) {
  if (evidence.driver == "BAG") {
    return SignDecision{Positive::kUp, "BAG holds elevations"};
  }
  const std::string attribute = Lower(Value(evidence, "positive"));
  if (attribute == "up" || attribute == "down") {
    return SignDecision{
        attribute == "up" ? Positive::kUp : Positive::kDown,
        absl::StrFormat("its attribute positive says \"%s\"", attribute)};
  }
  const std::pair<const char*, std::string> kDescriptions[] = {
      {"standard_name", Value(evidence, "standard_name")},
      {"band description", evidence.band_description},
      {"long_name", Value(evidence, "long_name")},
      {"variable name", Value(evidence, "netcdf_varname")},
  };
  for (const auto& [what, text] : kDescriptions) {
    const Positive says = WordsSay(text);
    if (says != Positive::kAuto) {
      return SignDecision{says,
                          absl::StrFormat("its %s says \"%s\"", what, text)};
    }
  }
  if (evidence.values > 0 && 2 * evidence.negative_values >= evidence.values) {
    return SignDecision{
        Positive::kUp,
        absl::StrFormat("%.0f %% of its values are below zero",
                        100.0 * static_cast<double>(evidence.negative_values) /
                            static_cast<double>(evidence.values))};
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: cannot tell elevations from depths (%d of %d sampled values are "
      "below zero and no metadata says): say --positive up or --positive down",
      evidence.file_name, evidence.negative_values, evidence.values));
}

}  // namespace fathom::client::cli
