// A scenario as a YAML file: one day at sea, and what must come of it.
//
// docs/scenarios.md is the schema: every key with its unit, range and default.
// Keys that are not in it are refused with their line.

#ifndef FATHOM_SIM_FEEDER_SCENARIO_FILE_H_
#define FATHOM_SIM_FEEDER_SCENARIO_FILE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sim_feeder/run_command.h"

namespace fathom::feeder {

// A bound on one figure of the evaluation.
struct Expectation {
  // JSON pointer into EvaluationJson: "/measured/rmse_m".
  std::string figure;
  std::optional<double> at_least = {};
  std::optional<double> at_most = {};
  // "bad_day.yaml:31".
  std::string place = {};
};

struct ScenarioFile {
  std::string title;
  // Without server.
  RunOptions run;
  // Places that the evaluation asks about.
  std::uint64_t evaluation_points = 20'000;
  std::vector<Expectation> expectations;
};

// Errors: INVALID_ARGUMENT naming file, line and key.
absl::StatusOr<ScenarioFile> ParseScenario(const std::string& text,
                                           const std::string& name);

// A relative raster is looked for beside the file. Errors: as ParseScenario,
// and NOT_FOUND.
absl::StatusOr<ScenarioFile> LoadScenario(const std::string& path);

// What an evaluation misses of them, one line each; empty: nothing. Errors:
// INVALID_ARGUMENT for a figure that the evaluation does not have.
absl::StatusOr<std::vector<std::string>> Missed(
    const std::vector<Expectation>& expectations,
    const std::string& evaluation_json);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SCENARIO_FILE_H_
