#include "sim_feeder/scenario_command.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/evaluate_command.h"
#include "sim_feeder/evaluation_files.h"
#include "sim_feeder/evaluation_report.h"
#include "sim_feeder/scenario_file.h"

namespace fathom::feeder {

absl::Status RunScenario(const ScenarioOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(ScenarioFile scenario, LoadScenario(options.path));
  RunOptions& run = scenario.run;
  run.link = options.link;
  run.rate = options.rate;
  run.show_progress = options.show_progress;
  if (options.seed.has_value()) run.scenario.seed = *options.seed;
  FATHOM_ASSIGN_OR_RETURN(const TruthSource truth,
                          TruthSource::Load(run.truth));
  if (options.link.server.empty()) {
    absl::FPrintF(stderr, "%s: %s: the file is good\n", options.path,
                  scenario.title);
    return absl::OkStatus();
  }
  FATHOM_ASSIGN_OR_RETURN(const std::vector<SurveyRecord> surveys,
                          PerformSurveys(run, truth));
  const SurveyRecord& survey = surveys.front();
  FATHOM_ASSIGN_OR_RETURN(
      const Evaluation judged,
      EvaluateSurvey(options.link, truth, survey, survey.end_time,
                     run.scenario.seed, scenario.evaluation_points));
  const auto& [depth, contacts] = judged;
  if (!options.out.empty()) {
    FATHOM_RETURN_IF_ERROR(WriteEvaluation(options.out, scenario.title,
                                           survey.area, depth, contacts));
  }
  const std::string evaluation = EvaluationJson(depth, contacts);
  FATHOM_ASSIGN_OR_RETURN(const std::vector<std::string> missed,
                          Missed(scenario.expectations, evaluation));
  if (options.json) {
    const nlohmann::ordered_json json = {
        {"scenario", scenario.title},
        {"survey", nlohmann::ordered_json::parse(ToJson(survey))},
        {"evaluation", nlohmann::ordered_json::parse(evaluation)},
        {"missed", missed}};
    absl::PrintF("%s\n", json.dump());
  } else {
    absl::PrintF("%s", EvaluationTable(depth, contacts));
    absl::PrintF("expectations: %d of %d met\n",
                 scenario.expectations.size() - missed.size(),
                 scenario.expectations.size());
  }
  if (missed.empty()) return absl::OkStatus();
  std::string all;
  for (const std::string& line : missed) all += "\n  " + line;
  return absl::FailedPreconditionError("expectations missed:" + all);
}

}  // namespace fathom::feeder
