#include "client/cli/question_flags.h"

#include <cstdint>

namespace fathom::client::cli {

v1::VerticalReference ReferenceOf(std::optional<double> water_level_m) {
  v1::VerticalReference reference;
  if (water_level_m.has_value()) {
    reference.set_reference(v1::DEPTH_REFERENCE_WATER_SURFACE);
    reference.set_water_level_m(*water_level_m);
  } else {
    reference.set_reference(v1::DEPTH_REFERENCE_MISSION_DATUM);
  }
  return reference;
}

void AddQuestionOptions(CLI::App& verb, QuestionFlags& flags) {
  verb.add_option("--confidence", flags.confidence,
                  "Certainty asked for, in (0.5, 1): OCCUPIED means P >= it, "
                  "FREE means P <= 1 - it")
      ->capture_default_str();
  verb.add_option("--clearance-m", flags.clearance_m,
                  "Water to keep above the seabed and below keels, metres")
      ->capture_default_str();
  verb.add_option("--water-level-m", flags.water_level_m,
                  "Depths are from the water surface, which stands this high "
                  "above the mission's datum, metres");
}

void AddUnknownOption(CLI::App& verb, v1::UnknownTreatment& treatment) {
  verb.add_flag_function(
      "--unknown-is-free",
      [&treatment](std::int64_t) { treatment = v1::UNKNOWN_TREATMENT_FREE; },
      "Pass over places that were neither measured nor charted (default: they "
      "count as obstacles)");
}

}  // namespace fathom::client::cli
