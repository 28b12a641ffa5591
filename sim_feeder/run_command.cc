#include "sim_feeder/run_command.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <ostream>
#include <thread>
#include <utility>
#include <variant>

#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "client/proto_time.h"
#include "sim_feeder/activity.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/progress_bar.h"

namespace fathom::feeder {
namespace {

using SteadyClock = std::chrono::steady_clock;

double SecondsSince(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

void AddAcks(const SinkState& state, SurveyRecord& record) {
  record.pings_durable = state.pings.durable_sequence;
  record.reports_durable = state.reports.durable_sequence;
  record.measurements_accepted = state.pings.measurements_accepted;
  record.reconnects = state.pings.reconnects + state.reports.reconnects;
  record.map_revision =
      std::max(state.pings.map_revision, state.reports.map_revision);
  record.rejects = RejectCounts(state.pings);
  record.report_rejects = RejectCounts(state.reports);
}

void WriteTrackLine(const Simulation& simulation, std::ostream& track) {
  const VehicleState& state = simulation.vehicle_state();
  const LocalTerrain& terrain = simulation.terrain();
  const map::GeodeticPoint place =
      terrain.frame().ToGeodetic(state.north_m, state.east_m);
  const double heading_deg =
      WrapTo360((state.course_rad - terrain.frame().NorthAzimuthRad(place)) *
                kDegreesPerRadian);
  track << absl::StrFormat(
      "%s,%.8f,%.8f,%.2f,%.2f,%.2f\n",
      FormatTime(simulation.TimeAt(simulation.now_s())), place.latitude_deg,
      place.longitude_deg, state.depth_m, heading_deg,
      terrain.DepthAt(state.north_m, state.east_m)
          .value_or(std::numeric_limits<double>::quiet_NaN()));
}

absl::StatusOr<SurveyArea> DecideArea(const RunOptions& options,
                                      const TruthSource& truth) {
  if (!options.auto_area_side_m.has_value()) return options.scenario.area;
  FATHOM_ASSIGN_OR_RETURN(
      const PickedArea picked,
      truth.Pick(*options.auto_area_side_m, options.scenario.area.cell_size_m,
                 options.scenario.min_water_m));
  const map::GeodeticPoint& corner = picked.area.south_west;
  absl::FPrintF(stderr,
                "area: --south-west %.6f,%.6f --north-extent-m %g "
                "--east-extent-m %g (%.0f %% usable water)\n",
                corner.latitude_deg, corner.longitude_deg,
                picked.area.north_extent_m, picked.area.east_extent_m,
                100.0 * picked.usable_share);
  return picked.area;
}

void PrintSummary(const SurveyRecord& record) {
  absl::FPrintF(
      stderr,
      "sent %d pings (%d measurements, %d without return), %d reports on %d "
      "ships; durable %d pings, %d reports; %.2f s, %.0f pings/s\n",
      record.pings, record.measurements, record.pings_silent,
      record.contact_reports, record.ships.size(), record.pings_durable,
      record.reports_durable, record.seconds,
      record.seconds > 0.0 ? static_cast<double>(record.pings) / record.seconds
                           : 0.0);
  for (const auto& [reason, count] : record.rejects) {
    absl::FPrintF(stderr, "measurements rejected: %s %d\n", reason, count);
  }
  for (const auto& [reason, count] : record.report_rejects) {
    absl::FPrintF(stderr, "reports rejected: %s %d\n", reason, count);
  }
}

absl::StatusOr<std::unique_ptr<Simulation>> PrepareSimulation(
    const RunOptions& options, const TruthSource& truth) {
  Scenario scenario = options.scenario;
  FATHOM_ASSIGN_OR_RETURN(scenario.area, DecideArea(options, truth));
  if (options.duration_s.has_value()) {
    if (!(*options.duration_s > 0.0) || !(*options.duration_s < 1e9)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "duration_s=%g must be in (0, 1e9)", *options.duration_s));
    }
    scenario.pings = static_cast<std::uint64_t>(
        std::ceil(*options.duration_s / scenario.ping_interval_s));
  }
  FATHOM_RETURN_IF_ERROR(ValidateScenario(scenario));
  FATHOM_ASSIGN_OR_RETURN(
      std::shared_ptr<const LocalTerrain> seabed,
      truth.SeabedAbout(scenario.area, scenario.sonar.fan.max_slant_range_m));
  const Time now =
      std::chrono::floor<std::chrono::seconds>(SystemClock().Now());
  scenario.start_time = options.start_time.value_or(now);
  FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<Simulation> simulation,
                          Simulation::Create(scenario, seabed));
  if (options.start_time.has_value() || options.rate > 0.0) return simulation;
  // Flat out: let it end now, so that nothing comes from the future.
  scenario.start_time =
      now - std::chrono::seconds(
                static_cast<std::int64_t>(simulation->duration_s()) + 1);
  return Simulation::Create(scenario, seabed);
}

}  // namespace

absl::Status DriveSurvey(Simulation& simulation, MessageSink& sink, double rate,
                         bool show_progress, std::ostream* track,
                         SurveyRecord& record) {
  ProgressBar bar(simulation.pings_planned(), "pings", show_progress);
  const SteadyClock::time_point start = SteadyClock::now();
  while (const std::optional<Simulation::Message> message = simulation.Next()) {
    if (rate > 0.0) {
      std::this_thread::sleep_until(
          start +
          std::chrono::duration_cast<SteadyClock::duration>(
              std::chrono::duration<double>(simulation.now_s() / rate)));
    }
    if (v1::Ping* const* ping = std::get_if<v1::Ping*>(&*message)) {
      FATHOM_RETURN_IF_ERROR(sink.SendPing(**ping));
      ++record.pings;
      record.measurements +=
          static_cast<std::uint64_t>((*ping)->range_m_size());
      if (track != nullptr) WriteTrackLine(simulation, *track);
    } else {
      FATHOM_RETURN_IF_ERROR(
          sink.SendReport(*std::get<v1::ContactReport*>(*message)));
      ++record.contact_reports;
    }
    if (bar.Due()) {
      bar.Update(simulation.pings_done(), RejectNote(sink.State()));
    }
  }
  FATHOM_RETURN_IF_ERROR(sink.Finish());
  record.seconds = SecondsSince(start);
  record.pings_silent = simulation.pings_silent();
  const SinkState state = sink.State();
  AddAcks(state, record);
  bar.Finish(simulation.pings_done(), RejectNote(state));
  return absl::OkStatus();
}

absl::StatusOr<SurveyRecord> PerformSurvey(const RunOptions& options,
                                           const TruthSource& truth) {
  if (!(options.rate >= 0.0) || !(options.rate <= 1e6)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "rate=%g must be in [0, 1e6]; 0 is flat out", options.rate));
  }
  FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<Simulation> simulation,
                          PrepareSimulation(options, truth));
  const Scenario& scenario = simulation->scenario();
  SurveyRecord record;
  record.activity_id = scenario.activity_id;
  record.source_id = options.source_id;
  record.seed = scenario.seed;
  record.truth = truth.Describe();
  record.start_time = scenario.start_time;
  record.end_time = simulation->TimeAt(simulation->duration_s());
  record.area = scenario.area;
  record.ships = simulation->ships();
  record.track_length_m = simulation->vehicle().length_m();
  record.track_spacing_m = simulation->track_spacing_m();

  std::ofstream track;
  if (!options.track_out.empty()) {
    track.open(options.track_out, std::ios::trunc);
    track << "time,latitude_deg,longitude_deg,depth_m,heading_deg,"
             "water_depth_m\n";
    if (!track) {
      return absl::PermissionDeniedError(
          absl::StrFormat("cannot write to %s", options.track_out));
    }
  }
  std::ostream* const track_stream = track.is_open() ? &track : nullptr;
  if (options.server.empty()) {
    FATHOM_ASSIGN_OR_RETURN(
        const std::unique_ptr<RecordSink> sink,
        RecordSink::Open(options.pings_out, options.reports_out,
                         options.source_id));
    FATHOM_RETURN_IF_ERROR(DriveSurvey(*simulation, *sink, options.rate,
                                       options.show_progress, track_stream,
                                       record));
  } else {
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<client::Client> client,
                            client::Client::Connect(options.server, {}));
    if (options.start_activity) {
      FATHOM_RETURN_IF_ERROR(
          OpenActivity(*client, {.id = scenario.activity_id,
                                 .vehicle_id = options.vehicle_id,
                                 .time = scenario.start_time,
                                 .area = scenario.area,
                                 .parameters = options.activity}));
    }
    client::IngestStreamOptions stream;
    stream.source_id = options.source_id;
    stream.epoch = options.epoch;
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<StreamSink> sink,
                            StreamSink::Open(*client, stream));
    FATHOM_RETURN_IF_ERROR(DriveSurvey(*simulation, *sink, options.rate,
                                       options.show_progress, track_stream,
                                       record));
    if (options.complete_activity) {
      FATHOM_RETURN_IF_ERROR(CompleteActivity(*client, scenario.activity_id));
    }
  }
  PrintSummary(record);
  return record;
}

absl::Status RunSurvey(const RunOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(const TruthSource truth,
                          TruthSource::Load(options.truth));
  FATHOM_ASSIGN_OR_RETURN(const SurveyRecord record,
                          PerformSurvey(options, truth));
  if (options.json) absl::PrintF("%s\n", ToJson(record));
  return absl::OkStatus();
}

}  // namespace fathom::feeder
