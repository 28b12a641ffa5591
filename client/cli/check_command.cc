// fathom check: can the vehicle go there? A timed trajectory against the map.

#include <memory>

#include "base/status_macros.h"
#include "client/cli/exit_code.h"
#include "client/cli/session.h"
#include "client/cli/trajectory_question.h"

namespace fathom::client::cli {
namespace {

struct CheckFlags {
  TrajectoryFlags trajectory;
  bool stop_at_first = false;
};

// 0: FREE throughout; else what a script must not overlook.
ExitCode ExitCodeOfVerdict(const v1::CheckTrajectoryResponse& response) {
  if (response.has_first_conflict()) return ExitCode::kConflict;
  return response.state() == v1::OBSTACLE_STATE_FREE ? ExitCode::kOk
                                                     : ExitCode::kUncertain;
}

absl::Status Run(Session& session, const CheckFlags& flags) {
  v1::CheckTrajectoryRequest request;
  FATHOM_ASSIGN_OR_RETURN(*request.mutable_trajectory(),
                          TrajectoryOf(flags.trajectory, session.Now()));
  request.set_stop_at_first(flags.stop_at_first);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::CheckTrajectoryResponse response,
                          client->CheckTrajectory(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else {
    Print(VerdictText(flags.trajectory.question.confidence, response));
  }
  session.exit_code = ExitCodeOfVerdict(response);
  return absl::OkStatus();
}

}  // namespace

void AddCheck(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "check", "Can the vehicle go there? A timed trajectory against the map");
  const auto f = std::make_shared<CheckFlags>();
  AddTrajectoryOptions(*verb, f->trajectory);
  verb->add_flag("--stop-at-first", f->stop_at_first,
                 "Do not look beyond the leg of the first conflict");
  verb->footer(
      "\nEvery cell of the map that the vehicle may touch is looked at, and "
      "every contact\nwhere it will be at the time. The state is the worst of "
      "all legs.\n"
      "\nExit codes beside the usual ones:\n"
      "  0  FREE throughout\n"
      "  5  a conflict: OCCUPIED, a point hazard, or UNKNOWN without\n"
      "     --unknown-is-free\n"
      "  6  no conflict, but somewhere not certain enough (UNCERTAIN)\n"
      "\nIn GeoJSON the third coordinate is a height: -20 is 20 m deep; times "
      "are the\nFeature's property \"times\", one for each coordinate.\n"
      "\nExamples:\n"
      "  fathom check plan.csv --radius-m 5 --clearance-m 3\n"
      "  fathom check plan.geojson --speed-m-s 1.5 --start +10min\n"
      "  printf '41.60,-71.40,20,now\\n41.61,-71.40,20,+20min\\n' | \\\n"
      "      fathom check - --position-std-m 10 --json");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
