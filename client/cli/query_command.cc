// fathom query: is there an obstacle at this place, time and confidence?

#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/answer_text.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/points_file.h"
#include "client/cli/question_flags.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

struct QueryFlags {
  std::string at;
  std::string points_file;
  std::optional<double> depth_m;
  std::string time;
  QuestionFlags question;
  double radius_m = 0;
};

std::string AnswerText(const QueryFlags& flags,
                       const v1::QueryObstacleRequest& question,
                       const v1::QueryObstacleResponse& response) {
  const v1::ObstacleAnswer& answer = response.answer();
  std::string text = absl::StrFormat(
      "%s at %.4g %% confidence: P(obstacle) = %.6g\n"
      "  asked     %s, %.4g m deep, clearance %.4g m, radius %.4g m, %s\n",
      StateText(answer.state()), 100 * flags.question.confidence,
      answer.probability(), PlaceText(question.position()), question.depth_m(),
      flags.question.clearance_m, flags.radius_m,
      question.has_time() ? TimeText(question.time()) : "now");
  return text + ReasonsText(answer) + StampText(response.stamp());
}

absl::Status AskOne(const Session& session, const QueryFlags& flags,
                    std::optional<Time> time) {
  v1::QueryObstacleRequest request;
  FATHOM_ASSIGN_OR_RETURN(*request.mutable_position(), ParsePoint(flags.at));
  if (!flags.depth_m.has_value()) {
    return UsageError(absl::InvalidArgumentError(
        "--at needs --depth-m: how deep the vehicle would be there"));
  }
  request.set_depth_m(*flags.depth_m);
  SetQuestion(flags.question, request);
  if (time.has_value()) *request.mutable_time() = ToProto(*time);
  request.set_radius_m(flags.radius_m);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::QueryObstacleResponse response,
                          client->QueryObstacle(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else {
    Print(AnswerText(flags, request, response));
  }
  return absl::OkStatus();
}

absl::Status AskMany(const Session& session, const QueryFlags& flags,
                     std::optional<Time> time) {
  FATHOM_ASSIGN_OR_RETURN(
      const std::vector<QuestionPoint> points,
      ReadPoints(flags.points_file, flags.depth_m, session.Now()));
  v1::QueryObstaclesRequest common;
  SetQuestion(flags.question, common);
  common.set_radius_m(flags.radius_m);
  common.set_with_reasons(true);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const PointAnswers answers,
                          AskPoints(*client, common, points, time));
  if (session.json) {
    PrintJson(AnswersJson(points, answers));
  } else {
    Print(AnswersCsv(points, answers));
  }
  return absl::OkStatus();
}

absl::Status Run(const Session& session, const QueryFlags& flags) {
  if (flags.at.empty() == flags.points_file.empty()) {
    return UsageError(absl::InvalidArgumentError(
        "say either --at LAT,LON or --points-file FILE (- for standard "
        "input)"));
  }
  std::optional<Time> time;
  if (!flags.time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(time, ParseMoment(flags.time, session.Now()));
  }
  return flags.at.empty() ? AskMany(session, flags, time)
                          : AskOne(session, flags, time);
}

}  // namespace

void AddQuery(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "query", "Is there an obstacle at this place, time and confidence?");
  const auto f = std::make_shared<QueryFlags>();
  verb->add_option("--at", f->at,
                   "The place, LAT,LON in degrees (south and west negative)");
  verb->add_option("--points-file", f->points_file,
                   "Many places: a CSV file (- is standard input) with "
                   "latitude_deg,longitude_deg,depth_m[,time]; a header line "
                   "may name the columns in another order");
  verb->add_option("--depth-m", f->depth_m,
                   "Depth of the vehicle there, metres below the mission's "
                   "datum; for points without one of their own too");
  verb->add_option("--time", f->time,
                   "When: now (default), +10min, --time=-30s, or "
                   "2026-01-01T12:00:00Z; past, present or future");
  AddQuestionOptions(*verb, f->question);
  verb->add_option("--radius-m", f->radius_m, "Radius of the vehicle, metres")
      ->capture_default_str();
  verb->footer(
      "\nThe answer is FREE, OCCUPIED, UNCERTAIN (P between) or UNKNOWN (no "
      "measurement\nand no chart there; never to be read as free).\n"
      "\nExamples:\n"
      "  fathom query --at 41.6,-71.4 --depth-m 20\n"
      "  fathom query --at 41.6,-71.4 --depth-m 20 --time +10min \\\n"
      "      --confidence 0.99 --clearance-m 2 --radius-m 5\n"
      "  printf '41.6,-71.4,20\\n41.5,-71.3,35\\n' | fathom query "
      "--points-file -");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
