#include "client/cli/trajectory_question.h"

#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/answer_text.h"
#include "client/cli/arguments.h"
#include "client/cli/text.h"
#include "client/cli/trajectory_file.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

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

}  // namespace

void AddTrajectoryOptions(CLI::App& verb, TrajectoryFlags& flags) {
  verb.add_option("trajectory", flags.file,
                  "CSV file (- is standard input) with "
                  "latitude_deg,longitude_deg,depth_m,time, or GeoJSON with "
                  "one LineString")
      ->required();
  verb.add_option("--depth-m", flags.depth_m,
                  "Depth of waypoints without one, metres below the "
                  "mission's datum");
  verb.add_option("--speed-m-s", flags.speed_m_s,
                  "Speed over ground where waypoints have no time")
      ->check(CLI::PositiveNumber);
  verb.add_option("--start", flags.start,
                  "When the vehicle is at the first waypoint, if that has no "
                  "time: now, +10min, or 2026-01-01T12:00:00Z")
      ->capture_default_str();
  AddQuestionOptions(verb, flags.question);
  verb.add_option("--radius-m", flags.radius_m, "Radius of the vehicle, metres")
      ->capture_default_str();
  verb.add_option("--position-std-m", flags.position_std_m,
                  "How well the vehicle knows where it is: 1 sigma on each "
                  "axis, metres; widens what is looked at")
      ->capture_default_str();
  AddUnknownOption(verb, flags.unknown);
}

absl::StatusOr<v1::Trajectory> TrajectoryOf(const TrajectoryFlags& flags,
                                            Time now) {
  TrajectoryDefaults defaults{
      .depth_m = flags.depth_m, .speed_m_s = flags.speed_m_s, .now = now};
  FATHOM_ASSIGN_OR_RETURN(defaults.start,
                          ParseMoment(flags.start, defaults.now));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<QuestionPoint> points,
                          ReadTrajectory(flags.file, defaults));
  v1::Trajectory trajectory;
  for (const QuestionPoint& point : points) {
    v1::Waypoint* waypoint = trajectory.add_waypoints();
    waypoint->mutable_position()->set_latitude_deg(point.latitude_deg);
    waypoint->mutable_position()->set_longitude_deg(point.longitude_deg);
    waypoint->set_depth_m(point.depth_m);
    *waypoint->mutable_time() = ToProto(*point.time);
  }
  SetQuestion(flags.question, trajectory);
  trajectory.set_radius_m(flags.radius_m);
  trajectory.set_position_std_m(flags.position_std_m);
  trajectory.set_treat_unknown_as(flags.unknown);
  return trajectory;
}

std::string VerdictText(double confidence,
                        const v1::CheckTrajectoryResponse& response) {
  std::string text =
      absl::StrFormat("%s at %.4g %% confidence\n", StateText(response.state()),
                      100 * confidence);
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

}  // namespace fathom::client::cli
