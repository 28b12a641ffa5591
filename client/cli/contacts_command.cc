// fathom contacts: the moving obstacles.

#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/contact_text.h"
#include "client/cli/exit_code.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

// "SOURCE/CONTACT" in two.
absl::StatusOr<std::pair<std::string, std::string>> ParseKey(
    const std::string& text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos || slash == 0 || slash + 1 == text.size()) {
    return UsageError(absl::InvalidArgumentError(absl::StrFormat(
        "\"%s\": say SOURCE/CONTACT as `fathom contacts list` prints it",
        text)));
  }
  return std::make_pair(text.substr(0, slash), text.substr(slash + 1));
}

absl::Status List(const Session& session, const std::string& time_text,
                  bool all) {
  v1::ListContactsRequest request;
  request.set_include_inactive(all);
  if (!time_text.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(time_text, session.Now()));
    *request.mutable_time() = ToProto(time);
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::ListContactsResponse response,
                          client->ListContacts(request));
  if (session.json) {
    PrintJson(ToJson(response));
    return absl::OkStatus();
  }
  if (response.contacts().empty()) {
    Print("no contact\n");
    return absl::OkStatus();
  }
  Print(std::string(kContactColumns));
  for (const v1::ContactEstimate& contact : response.contacts()) {
    Print(ContactRow(contact));
  }
  return absl::OkStatus();
}

struct HistoryFlags {
  std::string key;
  std::string from;
  std::string to;
  std::string south_west;
  std::string north_east;
};

absl::Status History(const Session& session, const HistoryFlags& flags) {
  v1::GetContactHistoryRequest request;
  if (flags.key.empty() && flags.south_west.empty()) {
    return UsageError(absl::InvalidArgumentError(
        "name SOURCE/CONTACT, or an area: --south-west and --north-east"));
  }
  if (!flags.key.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const auto key, ParseKey(flags.key));
    request.set_source_id(key.first);
    request.set_contact_id(key.second);
  }
  if (!flags.from.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(flags.from, session.Now()));
    *request.mutable_start_time() = ToProto(time);
  }
  if (!flags.to.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(flags.to, session.Now()));
    *request.mutable_end_time() = ToProto(time);
  }
  if (!flags.south_west.empty()) {
    FATHOM_ASSIGN_OR_RETURN(*request.mutable_south_west(),
                            ParsePoint(flags.south_west));
  }
  if (!flags.north_east.empty()) {
    FATHOM_ASSIGN_OR_RETURN(*request.mutable_north_east(),
                            ParsePoint(flags.north_east));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const std::vector<v1::ContactEstimate> estimates,
                          client->GetContactHistory(request));
  if (session.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const auto& estimate : estimates) list.push_back(ToJson(estimate));
    PrintJson({{"estimates", list}});
    return absl::OkStatus();
  }
  Print(std::string(kContactColumns));
  for (const v1::ContactEstimate& estimate : estimates)
    Print(ContactRow(estimate));
  return absl::OkStatus();
}

struct ReportFlags {
  std::string key;
  std::string contact_class = "unknown";
  std::string at;
  double velocity_north_m_s = 0;
  double velocity_east_m_s = 0;
  std::optional<double> position_std_m;
  std::optional<double> velocity_std_m_s;
  std::optional<double> depth_m;
  std::optional<double> depth_std_m;
  std::string time = "now";
  bool inactive = false;
};

absl::Status Report(const Session& session, const ReportFlags& flags) {
  v1::ReportContactsRequest request;
  v1::ContactReport& report = *request.add_reports();
  FATHOM_ASSIGN_OR_RETURN(const auto key, ParseKey(flags.key));
  report.set_source_id(key.first);
  report.set_contact_id(key.second);
  // One report by hand: its own epoch, so that it needs no count kept.
  report.set_epoch(static_cast<std::uint64_t>(ToUnixMicros(session.Now())));
  report.set_sequence(1);
  v1::ContactClass contact_class;
  if (!ClassFromText(flags.contact_class, &contact_class)) {
    return UsageError(
        absl::InvalidArgumentError("--class: no such class of contact"));
  }
  report.set_contact_class(contact_class);
  FATHOM_ASSIGN_OR_RETURN(const Time time,
                          ParseMoment(flags.time, session.Now()));
  *report.mutable_time() = ToProto(time);
  v1::ContactFix& fix = *report.mutable_fix();
  FATHOM_ASSIGN_OR_RETURN(*fix.mutable_position(), ParsePoint(flags.at));
  fix.set_velocity_north_m_s(flags.velocity_north_m_s);
  fix.set_velocity_east_m_s(flags.velocity_east_m_s);
  if (flags.position_std_m) fix.set_position_std_m(*flags.position_std_m);
  if (flags.velocity_std_m_s) {
    fix.set_velocity_std_m_s(*flags.velocity_std_m_s);
  }
  if (flags.depth_m) report.set_depth_m(*flags.depth_m);
  if (flags.depth_std_m) report.set_depth_std_m(*flags.depth_std_m);
  report.set_inactive(flags.inactive);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::ReportContactsResponse response,
                          client->ReportContacts(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else if (response.rejections().empty()) {
    Print(absl::StrFormat("reported %s; map revision %d\n", flags.key,
                          response.map_revision()));
  }
  if (response.rejections().empty()) return absl::OkStatus();
  const v1::Rejection& rejection = response.rejections(0);
  return absl::FailedPreconditionError(absl::StrFormat(
      "the tracker refused the report: %s %s",
      v1::RejectReason_Name(rejection.reason()), rejection.description()));
}

absl::Status Drop(const Session& session, const std::string& key_text,
                  const std::string& time_text) {
  v1::DropContactRequest request;
  FATHOM_ASSIGN_OR_RETURN(const auto key, ParseKey(key_text));
  request.set_source_id(key.first);
  request.set_contact_id(key.second);
  if (!time_text.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(time_text, session.Now()));
    *request.mutable_time() = ToProto(time);
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::DropContactResponse response,
                          client->DropContact(request));
  if (session.json) {
    PrintJson(ToJson(response));
  } else {
    Print(absl::StrFormat("dropped %s; its history stays; map revision %d\n",
                          key_text, response.map_revision()));
  }
  return absl::OkStatus();
}

void AddReport(CLI::App& verb, Session& session) {
  CLI::App* report = verb.add_subcommand(
      "report", "Tell the server of a contact's position and velocity");
  const auto f = std::make_shared<ReportFlags>();
  report->add_option("SOURCE/CONTACT", f->key, "Who reports which contact")
      ->required();
  report->add_option("--at", f->at, "Where it is, LAT,LON")->required();
  report
      ->add_option("--class", f->contact_class,
                   "unknown, small_craft, vessel, deep_draught, submerged "
                   "or drifting")
      ->check(CLI::IsMember({"unknown", "small_craft", "vessel", "deep_draught",
                             "submerged", "drifting"}))
      ->capture_default_str();
  report->add_option("--velocity-north-m-s", f->velocity_north_m_s,
                     "Velocity to the north, m/s");
  report->add_option("--velocity-east-m-s", f->velocity_east_m_s,
                     "Velocity to the east, m/s");
  report->add_option("--position-std-m", f->position_std_m,
                     "1-sigma of the position per axis, metres (default 10)");
  report->add_option("--velocity-std-m-s", f->velocity_std_m_s,
                     "1-sigma of the velocity per axis, m/s (default 0.5)");
  report->add_option("--depth-m", f->depth_m,
                     "Depth of a submerged contact, metres");
  report->add_option("--depth-std-m", f->depth_std_m, "Its 1-sigma, metres");
  report->add_option("--time", f->time, "When it was seen")
      ->capture_default_str();
  report->add_flag("--inactive", f->inactive, "It is gone: close its track");
  report->footer(
      "\nExample:\n  fathom contacts report bridge/ferry --at 41.61,-71.38 \\\n"
      "      --class vessel --velocity-north-m-s 4 --velocity-east-m-s=-2");
  report->callback([&session, f]() {
    session.run = [&session, f]() { return Report(session, *f); };
  });
}

}  // namespace

void AddContacts(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "contacts", "Moving obstacles: list, history, report, drop");
  verb->require_subcommand(1);

  CLI::App* list = verb->add_subcommand(
      "list", "Where the contacts are, or will be, at a time");
  const auto list_time = std::make_shared<std::string>();
  const auto all = std::make_shared<bool>(false);
  list->add_option("--time", *list_time,
                   "When: now (default), +10min, or RFC 3339; estimates are "
                   "predicted to it");
  list->add_flag("--all", *all, "Also stale and dropped ones");
  list->callback([&session, list_time, all]() {
    session.run = [&session, list_time, all]() {
      return List(session, *list_time, *all);
    };
  });

  CLI::App* history = verb->add_subcommand(
      "history",
      "One contact's track, or all that passed through an area, oldest first");
  const auto asked = std::make_shared<HistoryFlags>();
  history->add_option("SOURCE/CONTACT", asked->key,
                      "As `list` prints it; not needed with an area");
  history->add_option("--from", asked->from, "From this time, e.g. --from=-1h");
  history->add_option("--to", asked->to, "To this time");
  CLI::Option* const south_west =
      history
          ->add_option("--south-west", asked->south_west,
                       "Only within this area: its south-west corner")
          ->type_name("LAT,LON");
  history
      ->add_option("--north-east", asked->north_east,
                   "and its north-east corner")
      ->type_name("LAT,LON")
      ->needs(south_west);
  history->callback([&session, asked]() {
    session.run = [&session, asked]() { return History(session, *asked); };
  });

  AddReport(*verb, session);

  CLI::App* drop =
      verb->add_subcommand("drop", "Close a track; its history stays");
  const auto drop_key = std::make_shared<std::string>();
  const auto drop_time = std::make_shared<std::string>();
  drop->add_option("SOURCE/CONTACT", *drop_key, "As `list` prints it")
      ->required();
  drop->add_option("--time", *drop_time, "When it was gone (default: now)");
  drop->callback([&session, drop_key, drop_time]() {
    session.run = [&session, drop_key, drop_time]() {
      return Drop(session, *drop_key, *drop_time);
    };
  });
}

}  // namespace fathom::client::cli
