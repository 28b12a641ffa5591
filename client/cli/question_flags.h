// The flags that every question shares: how certain, how much water under and
// above the vehicle, what depths are measured from, what unknown water counts.

#ifndef FATHOM_CLIENT_CLI_QUESTION_FLAGS_H_
#define FATHOM_CLIENT_CLI_QUESTION_FLAGS_H_

#include <CLI/CLI.hpp>
#include <optional>

#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

// What depths on the command line are from: the water surface, so high above
// the mission's datum; absent: the datum itself.
v1::VerticalReference ReferenceOf(std::optional<double> water_level_m);

struct QuestionFlags {
  double confidence = 0.95;
  double clearance_m = 0;
  std::optional<double> water_level_m;
};

// --confidence, --clearance-m and --water-level-m; `flags` outlives the app.
void AddQuestionOptions(CLI::App& verb, QuestionFlags& flags);

// Writes them into a message of the contract that has these three fields.
template <typename Question>
void SetQuestion(const QuestionFlags& flags, Question& question) {
  question.set_confidence(flags.confidence);
  question.set_vertical_clearance_m(flags.clearance_m);
  *question.mutable_vertical_reference() = ReferenceOf(flags.water_level_m);
}

// --unknown-is-free, which sets `treatment`.
void AddUnknownOption(CLI::App& verb, v1::UnknownTreatment& treatment);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_QUESTION_FLAGS_H_
