// fathom activity: observation areas and their local maps.

#include <cmath>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

struct StartFlags {
  std::string activity_id;
  std::string vehicle_id;
  std::string south_west;
  std::string center;
  double size_m = 0;
  double north_m = 0;
  double east_m = 0;
  double cell_m = 10;
  std::string estimator = "adaptive";
  double min_range_m = 0;
  double max_range_m = 0;
  double smoothing_distance_m = 0;
  double smoothing_scale = 0;
  std::optional<double> default_depth_m;
  std::optional<double> default_std_m;
  std::string time;
};

absl::Status FillParameters(const StartFlags& flags,
                            v1::ActivityParameters& out) {
  const double north_m = flags.north_m > 0 ? flags.north_m : flags.size_m;
  const double east_m = flags.east_m > 0 ? flags.east_m : flags.size_m;
  if (north_m <= 0 || east_m <= 0) {
    return UsageError(absl::InvalidArgumentError(
        "no extent: say --size-m, or --north-m and --east-m"));
  }
  if (flags.south_west.empty() == flags.center.empty()) {
    return UsageError(absl::InvalidArgumentError(
        "no place, or two: say either --south-west or --center LAT,LON"));
  }
  if (!flags.center.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint center,
                            ParsePoint(flags.center));
    *out.mutable_south_west() = Offset(center, -north_m / 2, -east_m / 2);
  } else {
    FATHOM_ASSIGN_OR_RETURN(*out.mutable_south_west(),
                            ParsePoint(flags.south_west));
  }
  out.set_north_extent_m(north_m);
  out.set_east_extent_m(east_m);
  out.set_cell_size_m(flags.cell_m);
  out.set_estimator(flags.estimator == "nervegna" ? v1::ESTIMATOR_NERVEGNA
                    : flags.estimator == "kalman" ? v1::ESTIMATOR_KALMAN
                                                  : v1::ESTIMATOR_ADAPTIVE);
  out.set_min_range_m(flags.min_range_m);
  out.set_max_range_m(flags.max_range_m);
  out.set_smoothing_distance_m(flags.smoothing_distance_m);
  out.set_smoothing_scale(flags.smoothing_scale);
  if (flags.default_depth_m.has_value() != flags.default_std_m.has_value()) {
    return UsageError(absl::InvalidArgumentError(
        "--default-depth-m and --default-std-m belong together"));
  }
  if (flags.default_depth_m.has_value()) {
    out.mutable_default_prior()->set_depth_m(*flags.default_depth_m);
    out.mutable_default_prior()->set_std_m(*flags.default_std_m);
  }
  return absl::OkStatus();
}

std::string Line(const v1::ActivityStatus& a) {
  const v1::ActivityParameters& p = a.parameters();
  return absl::StrFormat(
      "%-16s %-6s SW %s  %.6g x %.6g m, %.4g m cells, %s\n"
      "                 started %s, %s cells measured, %s measurements, "
      "refused: %s\n",
      a.activity_id(), a.open() ? "open" : "ended", PlaceText(p.south_west()),
      p.north_extent_m(), p.east_extent_m(), p.cell_size_m(),
      EstimatorText(p.estimator()), TimeText(a.start_time()),
      CountText(a.cells_measured()), CountText(a.measurements_accepted()),
      RejectsText(a.rejects()));
}

std::string TransferText(const v1::TransferSummary& t) {
  std::string text = absl::StrFormat(
      "transferred %s local cells into %s leaves in %s; the global map has "
      "%s leaves (before: %s, before conglomeration: %s)\n",
      CountText(t.local_cells()), CountText(t.leaves_written()),
      SpanText(t.duration_s()), CountText(t.leaves_after()),
      CountText(t.leaves_before()), CountText(t.leaves_after_write()));
  if (t.degraded() > 0) {
    absl::StrAppendFormat(
        &text, "%s cells went to a coarser leaf: the global map is full\n",
        CountText(t.degraded()));
  }
  return text;
}

absl::Status Start(const Session& session, const StartFlags& flags) {
  v1::StartActivityRequest request;
  request.set_activity_id(flags.activity_id);
  request.set_vehicle_id(flags.vehicle_id);
  FATHOM_RETURN_IF_ERROR(FillParameters(flags, *request.mutable_parameters()));
  if (!flags.time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const Time time,
                            ParseMoment(flags.time, session.Now()));
    *request.mutable_time() = ToProto(time);
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::StartActivityResponse started,
                          client->StartActivity(request));
  if (session.json) {
    PrintJson(ToJson(started));
  } else {
    Print(Line(started.activity()));
  }
  return absl::OkStatus();
}

absl::Status Complete(const Session& session, const std::string& id,
                      bool discard) {
  v1::CompleteActivityRequest request;
  request.set_activity_id(id);
  request.set_discard(discard);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::CompleteActivityResponse completed,
                          client->CompleteActivity(request));
  if (session.json) {
    PrintJson(ToJson(completed));
  } else if (discard) {
    Print(id + " ended; its evidence was discarded\n");
  } else {
    Print(id + " ended; " + TransferText(completed.transfer()));
  }
  return absl::OkStatus();
}

absl::Status Transfer(const Session& session, const std::string& id) {
  v1::TransferLocalMapRequest request;
  request.set_activity_id(id);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::TransferLocalMapResponse transferred,
                          client->TransferLocalMap(request));
  if (session.json) {
    PrintJson(ToJson(transferred));
  } else {
    Print(TransferText(transferred.transfer()));
  }
  return absl::OkStatus();
}

absl::Status List(const Session& session) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  if (session.json) {
    nlohmann::ordered_json activities = nlohmann::ordered_json::array();
    for (const auto& a : status.activities()) activities.push_back(ToJson(a));
    PrintJson({{"activities", activities}});
    return absl::OkStatus();
  }
  if (status.activities().empty()) Print("no activity yet\n");
  for (const v1::ActivityStatus& a : status.activities()) Print(Line(a));
  return absl::OkStatus();
}

void AddStart(CLI::App& verb, Session& session) {
  CLI::App* start =
      verb.add_subcommand("start", "Open a local map over an observation area");
  const auto f = std::make_shared<StartFlags>();
  start->add_option("ID", f->activity_id, "A new name, [A-Za-z0-9._-]")
      ->required();
  start->add_option("--vehicle", f->vehicle_id, "The vehicle that surveys");
  start->add_option("--center", f->center, "Middle of the area, LAT,LON");
  start->add_option("--south-west", f->south_west,
                    "South-west corner of the area, LAT,LON");
  start->add_option("--size-m", f->size_m, "Side of a square area, metres");
  start->add_option("--north-m", f->north_m, "Extent to the north, metres");
  start->add_option("--east-m", f->east_m, "Extent to the east, metres");
  start->add_option("--cell-m", f->cell_m, "Side of a cell, metres")
      ->capture_default_str();
  start
      ->add_option("--estimator", f->estimator,
                   "How a cell joins its measurements: adaptive keeps the "
                   "variability inside the cell apart, kalman and nervegna "
                   "are the thesis's rules")
      ->check(CLI::IsMember({"adaptive", "kalman", "nervegna"}))
      ->capture_default_str();
  start->add_option("--min-range-m", f->min_range_m,
                    "Discard beams at or below this range, metres");
  start->add_option("--max-range-m", f->max_range_m,
                    "Discard beams at or above this range, metres "
                    "(default 1000)");
  start->add_option("--smoothing-distance-m", f->smoothing_distance_m,
                    "Fill cells this far from measured ones, metres");
  start->add_option("--smoothing-scale", f->smoothing_scale,
                    "Weight of the neighbours, in [0, 1)");
  start->add_option("--default-depth-m", f->default_depth_m,
                    "Depth where no chart knows anything, metres");
  start->add_option("--default-std-m", f->default_std_m,
                    "Its 1-sigma uncertainty, metres");
  start->add_option("--time", f->time,
                    "When it starts (default: the server's now)");
  start->footer(
      "\nExamples:\n"
      "  fathom activity start bay --center 41.6,-71.4 --size-m 1000\n"
      "  fathom activity start lane-3 --south-west 41.5,-71.4 \\\n"
      "      --north-m 5000 --east-m 800 --cell-m 1 --estimator kalman");
  start->callback([&session, f]() {
    session.run = [&session, f]() { return Start(session, *f); };
  });
}

}  // namespace

void AddActivity(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "activity", "Observation areas: start, complete, transfer, list");
  verb->require_subcommand(1);
  AddStart(*verb, session);

  CLI::App* complete = verb->add_subcommand(
      "complete", "End an activity; its evidence goes to the global map");
  const auto complete_id = std::make_shared<std::string>();
  const auto discard = std::make_shared<bool>(false);
  complete->add_option("ID", *complete_id, "The activity")->required();
  complete->add_flag("--discard", *discard,
                     "Throw the evidence away instead of transferring it");
  complete->callback([&session, complete_id, discard]() {
    session.run = [&session, complete_id, discard]() {
      return Complete(session, *complete_id, *discard);
    };
  });

  CLI::App* transfer = verb->add_subcommand(
      "transfer", "Copy the evidence so far to the global map and go on");
  const auto transfer_id = std::make_shared<std::string>();
  transfer->add_option("ID", *transfer_id, "The activity")->required();
  transfer->callback([&session, transfer_id]() {
    session.run = [&session, transfer_id]() {
      return Transfer(session, *transfer_id);
    };
  });

  verb->add_subcommand("list", "All activities, open ones first")
      ->callback([&session]() {
        session.run = [&session]() { return List(session); };
      });
}

}  // namespace fathom::client::cli
