// fathom check: can the vehicle go there? A timed trajectory against the map.

#include <memory>
#include <optional>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/answer_text.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/question_flags.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/cli/trajectory_file.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

struct CheckFlags {
  std::string file;
  std::optional<double> depth_m;
  std::optional<double> speed_m_s;
  std::string start = "now";
  QuestionFlags question;
  double radius_m = 0;
  double position_std_m = 0;
  v1::UnknownTreatment unknown = v1::UNKNOWN_TREATMENT_OCCUPIED;
  bool stop_at_first = false;
};

std::string LegsText(const v1::CheckTrajectoryResponse& response) {
  std::string text = "  leg  state      worst P   least clearance\n";
  for (int i = 0; i < response.legs_size(); ++i) {
    const v1::LegVerdict& leg = response.legs(i);
    absl::StrAppendFormat(
        &text, "  %3d  %-9s  %-8.4g  %s\n", i, StateText(leg.state()),
        leg.worst_probability(),
        leg.has_least_clearance_m()
            ? absl::StrFormat("%.2f m", leg.least_clearance_m())
            : "unknown");
  }
  return text;
}

std::string VerdictText(const CheckFlags& flags,
                        const v1::CheckTrajectoryResponse& response) {
  std::string text =
      absl::StrFormat("%s at %.4g %% confidence\n", StateText(response.state()),
                      100 * flags.question.confidence);
  if (response.has_first_conflict()) {
    const v1::Conflict& conflict = response.first_conflict();
    absl::StrAppendFormat(
        &text, "first conflict on leg %d, %s, vehicle %.2f m deep: %s at %s\n",
        conflict.leg_index(), TimeText(conflict.time()), conflict.depth_m(),
        StateText(conflict.answer().state()), PlaceText(conflict.position()));
    text += ReasonsText(conflict.answer());
  }
  text += LegsText(response);
  for (const v1::ContactApproach& approach : response.approaches()) {
    absl::StrAppendFormat(
        &text, "  contact   %s/%s: closest %.1f m at %s; P = %.6g\n",
        approach.source_id(), approach.contact_id(), approach.distance_m(),
        TimeText(approach.time()), approach.probability());
  }
  return text + StampText(response.stamp());
}

// 0: FREE throughout; else what a script must not overlook.
ExitCode ExitCodeOfVerdict(const v1::CheckTrajectoryResponse& response) {
  if (response.has_first_conflict()) return ExitCode::kConflict;
  return response.state() == v1::OBSTACLE_STATE_FREE ? ExitCode::kOk
                                                     : ExitCode::kUncertain;
}

absl::Status Run(Session& session, const CheckFlags& flags) {
  TrajectoryDefaults defaults{.depth_m = flags.depth_m,
                              .speed_m_s = flags.speed_m_s,
                              .now = session.Now()};
  FATHOM_ASSIGN_OR_RETURN(defaults.start,
                          ParseMoment(flags.start, defaults.now));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<QuestionPoint> points,
                          ReadTrajectory(flags.file, defaults));
  v1::CheckTrajectoryRequest request;
  v1::Trajectory* trajectory = request.mutable_trajectory();
  for (const QuestionPoint& point : points) {
    v1::Waypoint* waypoint = trajectory->add_waypoints();
    waypoint->mutable_position()->set_latitude_deg(point.latitude_deg);
    waypoint->mutable_position()->set_longitude_deg(point.longitude_deg);
    waypoint->set_depth_m(point.depth_m);
    *waypoint->mutable_time() = ToProto(*point.time);
  }
  SetQuestion(flags.question, *trajectory);
  trajectory->set_radius_m(flags.radius_m);
  trajectory->set_position_std_m(flags.position_std_m);
  trajectory->set_treat_unknown_as(flags.unknown);
  request.set_stop_at_first(flags.stop_at_first);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::CheckTrajectoryResponse response,
                          client->CheckTrajectory(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else {
    Print(VerdictText(flags, response));
  }
  session.exit_code = ExitCodeOfVerdict(response);
  return absl::OkStatus();
}

}  // namespace

void AddCheck(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "check", "Can the vehicle go there? A timed trajectory against the map");
  const auto f = std::make_shared<CheckFlags>();
  verb->add_option("trajectory", f->file,
                   "CSV file (- is standard input) with "
                   "latitude_deg,longitude_deg,depth_m,time, or GeoJSON with "
                   "one LineString")
      ->required();
  verb->add_option("--depth-m", f->depth_m,
                   "Depth of waypoints without one, metres below the "
                   "mission's datum");
  verb->add_option("--speed-m-s", f->speed_m_s,
                   "Speed over ground where waypoints have no time")
      ->check(CLI::PositiveNumber);
  verb->add_option("--start", f->start,
                   "When the vehicle is at the first waypoint, if that has no "
                   "time: now, +10min, or 2026-01-01T12:00:00Z")
      ->capture_default_str();
  AddQuestionOptions(*verb, f->question);
  verb->add_option("--radius-m", f->radius_m, "Radius of the vehicle, metres")
      ->capture_default_str();
  verb->add_option("--position-std-m", f->position_std_m,
                   "How well the vehicle knows where it is: 1 sigma on each "
                   "axis, metres; widens what is looked at")
      ->capture_default_str();
  AddUnknownOption(*verb, f->unknown);
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
