#include "sim_feeder/run_command.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <latch>
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
#include "sim_feeder/evaluate_command.h"
#include "sim_feeder/evaluation_files.h"
#include "sim_feeder/evaluation_report.h"
#include "sim_feeder/progress_bar.h"
#include "sim_feeder/start_line.h"

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
  record.dropped = state.dropped;
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

// Of all vehicles of a run.
void PrintSummary(const std::vector<SurveyRecord>& records) {
  SurveyRecord all;
  std::size_t ships = 0;
  for (const SurveyRecord& record : records) {
    all.pings += record.pings;
    all.measurements += record.measurements;
    all.pings_silent += record.pings_silent;
    all.contact_reports += record.contact_reports;
    all.pings_durable += record.pings_durable;
    all.reports_durable += record.reports_durable;
    all.dropped += record.dropped;
    all.seconds = std::max(all.seconds, record.seconds);
    ships += record.ships.size();
    for (const auto& [reason, count] : record.rejects) {
      all.rejects[reason] += count;
    }
    for (const auto& [reason, count] : record.report_rejects) {
      all.report_rejects[reason] += count;
    }
  }
  if (records.size() > 1)
    absl::FPrintF(stderr, "%d vehicles: ", records.size());
  absl::FPrintF(
      stderr,
      "sent %d pings (%d measurements, %d without return), %d reports on %d "
      "ships; durable %d pings, %d reports; %.2f s, %.0f pings/s\n",
      all.pings, all.measurements, all.pings_silent, all.contact_reports, ships,
      all.pings_durable, all.reports_durable, all.seconds,
      all.seconds > 0.0 ? static_cast<double>(all.pings) / all.seconds : 0.0);
  if (all.dropped > 0) {
    absl::FPrintF(stderr, "dropped by a full buffer: %d messages\n",
                  all.dropped);
  }
  for (const auto& [reason, count] : all.rejects) {
    absl::FPrintF(stderr, "measurements rejected: %s %d\n", reason, count);
  }
  for (const auto& [reason, count] : all.report_rejects) {
    absl::FPrintF(stderr, "reports rejected: %s %d\n", reason, count);
  }
}

// The number-th vehicle's own part of a run, counted from 1.
RunOptions OptionsOf(const RunOptions& options, int number) {
  RunOptions own = options;
  if (options.vehicles == 1) return own;
  const std::string suffix = absl::StrFormat("-%d", number);
  own.link.source_id += suffix;
  if (!own.link.buffer.empty()) own.link.buffer += "/" + own.link.source_id;
  if (!own.vehicle_id.empty()) own.vehicle_id += suffix;
  if (options.share_activity) {
    // Opened before and completed after all of them.
    own.start_activity = false;
    own.complete_activity = false;
  } else {
    own.scenario.activity_id += suffix;
  }
  own.scenario.seed += static_cast<std::uint64_t>(number - 1);
  own.prepare_mib /= static_cast<std::uint64_t>(options.vehicles);
  // One bar on one terminal.
  own.show_progress = options.show_progress && number == 1;
  return own;
}

// REQUIRES: the area was decided, the seabed lies about it.
absl::StatusOr<std::unique_ptr<Simulation>> PrepareSimulation(
    const RunOptions& options,
    const std::shared_ptr<const LocalTerrain>& seabed) {
  Scenario scenario = options.scenario;
  if (options.duration_s.has_value()) {
    if (!(*options.duration_s > 0.0) || !(*options.duration_s < 1e9)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "duration_s=%g must be in (0, 1e9)", *options.duration_s));
    }
    scenario.pings = static_cast<std::uint64_t>(
        std::ceil(*options.duration_s / scenario.ping_interval_s));
  }
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

SurveyRecord RecordOf(const RunOptions& options, const Simulation& simulation,
                      const TruthSource& truth) {
  const Scenario& scenario = simulation.scenario();
  SurveyRecord record;
  record.activity_id = scenario.activity_id;
  record.source_id = options.link.source_id;
  record.seed = scenario.seed;
  record.truth = truth.Describe();
  record.start_time = scenario.start_time;
  record.end_time = simulation.TimeAt(simulation.duration_s());
  record.area = scenario.area;
  record.ships = simulation.ships();
  record.track_length_m = simulation.vehicle().length_m();
  record.track_spacing_m = simulation.track_spacing_m();
  return record;
}

ActivityToOpen ActivityOf(const RunOptions& options, const Scenario& scenario) {
  return {.id = scenario.activity_id,
          .vehicle_id = options.vehicle_id,
          .time = scenario.start_time,
          .area = scenario.area,
          .parameters = options.activity};
}

// One vehicle's messages into the server or the record files, from the moment
// on when all vehicles have their first ones and their streams.
absl::Status SendSurvey(const RunOptions& options, Simulation& simulation,
                        std::latch& line, SurveyRecord& record) {
  StartPlace place(line);
  PreparedMessages messages(simulation, options.prepare_mib << 20);
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
  if (options.link.server.empty()) {
    FATHOM_ASSIGN_OR_RETURN(
        const std::unique_ptr<RecordSink> sink,
        RecordSink::Open(options.pings_out, options.reports_out,
                         options.link.source_id));
    place.WaitForAll();
    return DriveSurvey(messages, *sink, options.rate, options.show_progress,
                       track_stream, record);
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<client::Client> client,
                          Connect(options.link, !options.link.buffer.empty() &&
                                                    !options.start_activity));
  if (options.start_activity) {
    FATHOM_RETURN_IF_ERROR(
        OpenActivity(*client, ActivityOf(options, simulation.scenario())));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MessageSink> sink,
                          OpenSink(*client, options.link, options.rate > 0.0));
  place.WaitForAll();
  FATHOM_RETURN_IF_ERROR(DriveSurvey(messages, *sink, options.rate,
                                     options.show_progress, track_stream,
                                     record));
  if (record.reconnects > 0 && options.start_activity) {
    // Acks that a cut swallowed are counted nowhere else.
    FATHOM_ASSIGN_OR_RETURN(const ActivityCounts counts,
                            CountsOf(*client, record.activity_id));
    record.measurements_accepted = counts.measurements_accepted;
    record.rejects = counts.rejects;
  }
  if (options.complete_activity) {
    return CompleteActivity(*client, record.activity_id);
  }
  return absl::OkStatus();
}

absl::Status ValidateRun(const RunOptions& options) {
  if (!(options.rate >= 0.0) || !(options.rate <= 1e6)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "rate=%g must be in [0, 1e6]; 0 is flat out", options.rate));
  }
  if (options.vehicles < 1 || options.vehicles > kMaxVehicles) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "vehicles=%d must be 1 to %d", options.vehicles, kMaxVehicles));
  }
  if (options.vehicles > 1 &&
      !(options.pings_out.empty() && options.reports_out.empty() &&
        options.track_out.empty())) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "vehicles=%d would write to one file; run them one by one",
        options.vehicles));
  }
  if (!options.evaluate_out.empty() &&
      (options.vehicles > 1 || options.link.server.empty())) {
    return absl::InvalidArgumentError(
        "a run is evaluated by asking its server, one vehicle's at a time");
  }
  if (options.prepare_mib > 0 && !options.track_out.empty()) {
    return absl::InvalidArgumentError(
        "a track is written as it is gone, not while messages are made ahead: "
        "prepare_mib or track_out");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status DriveSurvey(PreparedMessages& messages, MessageSink& sink,
                         double rate, bool show_progress, std::ostream* track,
                         SurveyRecord& record) {
  const Simulation& simulation = messages.simulation();
  ProgressBar bar(simulation.pings_planned(), "pings", show_progress);
  const SteadyClock::time_point start = SteadyClock::now();
  absl::Status sent;
  while (sent.ok()) {
    const std::optional<Simulation::Message> message = messages.Next();
    if (!message.has_value()) break;
    if (rate > 0.0) {
      std::this_thread::sleep_until(
          start + std::chrono::duration_cast<SteadyClock::duration>(
                      std::chrono::duration<double>(messages.now_s() / rate)));
    }
    if (v1::Ping* const* ping = std::get_if<v1::Ping*>(&*message)) {
      sent = sink.SendPing(**ping);
      if (!sent.ok()) break;
      ++record.pings;
      record.measurements +=
          static_cast<std::uint64_t>((*ping)->range_m_size());
      if (track != nullptr) WriteTrackLine(simulation, *track);
    } else {
      sent = sink.SendReport(*std::get<v1::ContactReport*>(*message));
      if (!sent.ok()) break;
      ++record.contact_reports;
    }
    if (bar.Due()) {
      bar.Update(messages.pings_done(), RejectNote(sink.State()));
    }
  }
  // What was sent and dropped is told even if the end is not reached.
  if (sent.ok()) sent = sink.Finish();
  record.seconds = SecondsSince(start);
  record.pings_silent = simulation.pings_silent();
  const SinkState state = sink.State();
  AddAcks(state, record);
  bar.Finish(messages.pings_done(), RejectNote(state));
  return sent;
}

absl::StatusOr<std::vector<SurveyRecord>> PerformSurveys(
    const RunOptions& options, const TruthSource& truth) {
  FATHOM_RETURN_IF_ERROR(ValidateRun(options));
  RunOptions decided = options;
  FATHOM_ASSIGN_OR_RETURN(decided.scenario.area, DecideArea(options, truth));
  FATHOM_RETURN_IF_ERROR(ValidateScenario(decided.scenario));
  FATHOM_ASSIGN_OR_RETURN(
      const std::shared_ptr<const LocalTerrain> seabed,
      truth.SeabedAbout(decided.scenario.area,
                        decided.scenario.sonar.fan.max_slant_range_m));
  std::vector<RunOptions> own;
  std::vector<std::unique_ptr<Simulation>> simulations;
  std::vector<SurveyRecord> records;
  for (int number = 1; number <= options.vehicles; ++number) {
    own.push_back(OptionsOf(decided, number));
    FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<Simulation> simulation,
                            PrepareSimulation(own.back(), seabed));
    records.push_back(RecordOf(own.back(), *simulation, truth));
    simulations.push_back(std::move(simulation));
  }
  std::unique_ptr<client::Client> client;
  if (options.vehicles > 1 && options.share_activity &&
      !options.link.server.empty()) {
    FATHOM_ASSIGN_OR_RETURN(client, Connect(options.link));
    if (options.start_activity) {
      FATHOM_RETURN_IF_ERROR(OpenActivity(
          *client, ActivityOf(decided, simulations.front()->scenario())));
    }
  }
  std::vector<absl::Status> ends(own.size());
  std::latch line(std::ssize(own));
  std::vector<std::thread> vehicles;
  for (std::size_t i = 0; i < own.size(); ++i) {
    vehicles.emplace_back([&, i] {
      ends[i] = SendSurvey(own[i], *simulations[i], line, records[i]);
    });
  }
  for (std::thread& vehicle : vehicles) vehicle.join();
  if (std::any_of(records.begin(), records.end(),
                  [](const SurveyRecord& r) { return r.pings > 0; })) {
    PrintSummary(records);
  }
  const auto failed =
      std::find_if_not(ends.begin(), ends.end(),
                       [](const absl::Status& end) { return end.ok(); });
  if (failed != ends.end() && ends.size() > 1) {
    const auto which = static_cast<std::size_t>(failed - ends.begin());
    return absl::Status(
        failed->code(),
        absl::StrFormat(
            "%s (%d of %d vehicles failed): %s", records[which].source_id,
            std::count_if(ends.begin(), ends.end(),
                          [](const absl::Status& end) { return !end.ok(); }),
            ends.size(), failed->message()));
  }
  if (failed != ends.end()) return *failed;
  if (client != nullptr && options.complete_activity) {
    FATHOM_RETURN_IF_ERROR(
        CompleteActivity(*client, options.scenario.activity_id));
  }
  return records;
}

absl::Status RunSurvey(const RunOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(const TruthSource truth,
                          TruthSource::Load(options.truth));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<SurveyRecord> records,
                          PerformSurveys(options, truth));
  if (options.json) {
    for (const SurveyRecord& record : records) {
      absl::PrintF("%s\n", ToJson(record));
    }
  }
  if (!options.evaluate_out.empty()) {
    const SurveyRecord& survey = records.front();
    FATHOM_ASSIGN_OR_RETURN(
        const Evaluation judged,
        EvaluateSurvey(options.link, truth, survey, survey.end_time,
                       survey.seed, kDefaultPoints));
    absl::FPrintF(stderr, "%s", EvaluationTable(judged.depth, judged.contacts));
    return WriteEvaluation(options.evaluate_out, truth.Describe(), survey.area,
                           judged.depth, judged.contacts);
  }
  return absl::OkStatus();
}

}  // namespace fathom::feeder
