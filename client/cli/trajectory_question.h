// A trajectory and how it is judged: the flags that `check` and `watch
// trajectory` share, and their verdicts for people.

#ifndef FATHOM_CLIENT_CLI_TRAJECTORY_QUESTION_H_
#define FATHOM_CLIENT_CLI_TRAJECTORY_QUESTION_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/cli/question_flags.h"
#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

struct TrajectoryFlags {
  std::string file;
  std::optional<double> depth_m;
  std::optional<double> speed_m_s;
  std::string start = "now";
  QuestionFlags question;
  double radius_m = 0;
  double position_std_m = 0;
  v1::UnknownTreatment unknown = v1::UNKNOWN_TREATMENT_OCCUPIED;
};

// The file and all flags; `flags` outlives the app.
void AddTrajectoryOptions(CLI::App& verb, TrajectoryFlags& flags);

// What they ask. Errors: as ReadTrajectory and ParseMoment.
absl::StatusOr<v1::Trajectory> TrajectoryOf(const TrajectoryFlags& flags,
                                            Time now);

// Some lines, with reasons.
std::string VerdictText(double confidence,
                        const v1::CheckTrajectoryResponse& response);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_TRAJECTORY_QUESTION_H_
