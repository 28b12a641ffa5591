// fathom nearest: what is the nearest thing that the vehicle must not run into?

#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/answer_text.h"
#include "client/cli/arguments.h"
#include "client/cli/question_flags.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

struct NearestFlags {
  std::string at;
  double depth_m = 0;
  double radius_m = 5000;
  std::string time;
  QuestionFlags question;
  v1::UnknownTreatment unknown = v1::UNKNOWN_TREATMENT_OCCUPIED;
};

std::string NearestText(const NearestFlags& flags,
                        const v1::FindNearestObstacleResponse& response) {
  std::string text;
  if (!response.found()) {
    text = absl::StrFormat("nothing within %.4g m at %.4g %% confidence\n",
                           flags.radius_m, 100 * flags.question.confidence);
  } else {
    const v1::ObstacleAnswer& answer = response.answer();
    text = absl::StrFormat(
        "%s %.1f m away, bearing %.1f degrees: %s\n",
        response.contact_id().empty()
            ? StateText(answer.state())
            : "contact " + response.source_id() + "/" + response.contact_id(),
        response.distance_m(), response.bearing_deg(),
        PlaceText(response.position()));
    text += ReasonsText(answer);
  }
  return text + StampText(response.stamp());
}

absl::Status Run(const Session& session, const NearestFlags& flags) {
  v1::FindNearestObstacleRequest request;
  FATHOM_ASSIGN_OR_RETURN(*request.mutable_position(), ParsePoint(flags.at));
  request.set_depth_m(flags.depth_m);
  SetQuestion(flags.question, request);
  if (!flags.time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(flags.time, session.Now()));
    *request.mutable_time() = ToProto(time);
  }
  request.set_search_radius_m(flags.radius_m);
  request.set_treat_unknown_as(flags.unknown);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::FindNearestObstacleResponse response,
                          client->FindNearestObstacle(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else {
    Print(NearestText(flags, response));
  }
  return absl::OkStatus();
}

}  // namespace

void AddNearest(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "nearest", "The nearest place or contact that is not passable");
  const auto f = std::make_shared<NearestFlags>();
  verb->add_option("--at", f->at, "From where, LAT,LON in degrees")->required();
  verb->add_option("--depth-m", f->depth_m,
                   "Depth of the vehicle, metres below the mission's datum")
      ->required();
  verb->add_option("--radius-m", f->radius_m,
                   "How far to look, metres, at most 50000")
      ->capture_default_str();
  verb->add_option("--time", f->time,
                   "When: now (default), +10min, or 2026-01-01T12:00:00Z; "
                   "contacts are where they will be then");
  AddQuestionOptions(*verb, f->question);
  AddUnknownOption(*verb, f->unknown);
  verb->footer(
      "\nThe distance is to the nearest point of the cell of the map, or of "
      "the disc that\nholds the contact; 0: the place itself is not "
      "passable. The bearing is true.\n"
      "\nExamples:\n"
      "  fathom nearest --at 41.6,-71.4 --depth-m 20\n"
      "  fathom nearest --at 41.6,-71.4 --depth-m 20 --clearance-m 3 \\\n"
      "      --radius-m 20000 --time +10min --unknown-is-free --json");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
