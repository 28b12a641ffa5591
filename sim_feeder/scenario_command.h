// `fathom-feeder scenario`: a scenario file into a live server, judged by its
// own expectations.

#ifndef FATHOM_SIM_FEEDER_SCENARIO_COMMAND_H_
#define FATHOM_SIM_FEEDER_SCENARIO_COMMAND_H_

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "sim_feeder/link.h"

namespace fathom::feeder {

struct ScenarioOptions {
  std::string path;
  // Without a server: only check the file.
  LinkOptions link;
  // In place of the file's.
  std::optional<std::uint64_t> seed;
  double rate = 0.0;
  // Not empty: evaluation_files.h into this folder.
  std::string out;
  bool show_progress = false;
  bool json = false;
};

// Runs, evaluates and prints: a table for people, or with `json` one line
// {"scenario", "survey": {...}, "evaluation": {...}, "missed": [...]}.
//
// Errors: as LoadScenario, PerformSurvey and the evaluation;
// FAILED_PRECONDITION naming each expectation that was missed.
absl::Status RunScenario(const ScenarioOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SCENARIO_COMMAND_H_
