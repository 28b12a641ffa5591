// fathom-feeder: a simulated survey into a live server, and how well the
// server's map agrees with the truth. `fathom-feeder --help` says the rest.

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "base/time.h"
#include "sim_feeder/evaluate_command.h"
#include "sim_feeder/link.h"
#include "sim_feeder/questions_command.h"
#include "sim_feeder/replay/replay_command.h"
#include "sim_feeder/run_command.h"
#include "sim_feeder/scenario_command.h"

namespace fathom::feeder {
namespace {

// A flag of the form LAT,LON in degrees.
CLI::Option* AddPoint(CLI::App& app, const std::string& name,
                      map::GeodeticPoint& point, const std::string& help) {
  return app
      .add_option_function<std::vector<double>>(
          name,
          [&point](const std::vector<double>& values) {
            point = {.latitude_deg = values[0], .longitude_deg = values[1]};
            const absl::Status status = map::ValidateGeodetic(point);
            if (!status.ok()) {
              throw CLI::ValidationError(std::string(status.message()));
            }
          },
          help + " (latitude,longitude in degrees)")
      ->delimiter(',')
      ->expected(2)
      ->type_name("LAT,LON");
}

void AddTime(CLI::App& app, const std::string& name, std::optional<Time>& time,
             const std::string& help) {
  app.add_option_function<std::string>(
         name,
         [&time](const std::string& text) {
           const absl::StatusOr<Time> parsed = ParseTime(text);
           if (!parsed.ok()) {
             throw CLI::ValidationError(std::string(parsed.status().message()));
           }
           time = *parsed;
         },
         help)
      ->type_name("RFC3339");
}

void AddTruth(CLI::App& app, TruthOptions& truth) {
  CLI::Option* file = app.add_option(
      "--truth", truth.path, "Truth terrain: any raster that GDAL reads");
  app.add_option_function<std::string>(
         "--truth-positive",
         [&truth](const std::string& name) {
           const absl::StatusOr<Positive> positive = ParsePositive(name);
           if (!positive.ok()) {
             throw CLI::ValidationError(
                 std::string(positive.status().message()));
           }
           truth.positive = *positive;
         },
         "Whether its values are elevations (up) or depths (down); auto reads "
         "its metadata")
      ->type_name("auto|up|down");
  // Says only what is the default: the truth's path stays empty.
  app.add_flag_function(
         "--etopo", [](std::int64_t) {},
         "Truth terrain: ETOPO5 with seeded fractal relief (the default "
         "without --truth)")
      ->excludes(file);
  app.add_option("--etopo-file", truth.etopo_path, "Where ETOPO5 is")
      ->capture_default_str();
  AddPoint(app, "--center", truth.center,
           "With ETOPO5: look for an area about here");
  app.add_option("--relief-std-m", truth.relief.std_m,
                 "With ETOPO5: 1 sigma of the relief")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--relief-length-m", truth.relief.correlation_length_m,
                 "With ETOPO5: correlation length of the relief")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--relief-seed", truth.relief.seed,
                 "With ETOPO5: seed of the relief, apart from --seed")
      ->capture_default_str();
  app.add_option("--truth-cell-m", truth.fine_cell_m,
                 "With ETOPO5: side of the cells that carry the relief")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
}

CLI::Option* AddArea(CLI::App& app, SurveyArea& area) {
  CLI::Option* corner = AddPoint(app, "--south-west", area.south_west,
                                 "South-west corner of the area");
  CLI::Option* north = app.add_option("--north-extent-m", area.north_extent_m,
                                      "Its extent to the north");
  CLI::Option* east = app.add_option("--east-extent-m", area.east_extent_m,
                                     "Its extent to the east");
  corner->needs(north)->needs(east);
  app.add_option("--cell-m", area.cell_size_m, "Cell of the local map")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  return corner;
}

// Of `run` and `replay` both.
template <typename Options>
void AddActivity(CLI::App& app, Options& run) {
  app.add_option("--vehicle", run.vehicle_id, "Vehicle id of the activity");
  app.add_flag("!--no-start", run.start_activity,
               "The activity is open already: do not start it");
  app.add_flag("--complete", run.complete_activity,
               "Complete the activity at the end");
  app.add_option_function<std::string>(
         "--estimator",
         [&run](const std::string& name) {
           v1::Estimator estimator = v1::ESTIMATOR_UNSPECIFIED;
           if (name == "nervegna") estimator = v1::ESTIMATOR_NERVEGNA;
           if (name == "kalman") estimator = v1::ESTIMATOR_KALMAN;
           if (name == "adaptive") estimator = v1::ESTIMATOR_ADAPTIVE;
           run.activity.set_estimator(estimator);
         },
         "How local cells join measurements (default: the server's)")
      ->check(CLI::IsMember({"nervegna", "kalman", "adaptive"}));
  const auto number = [&](const std::string& name, const std::string& help,
                          const std::function<void(double)>& set) {
    app.add_option_function<double>(name, set, help);
  };
  number("--map-min-range-m", "The map discards ranges at or below",
         [&](double v) { run.activity.set_min_range_m(v); });
  number("--map-max-range-m", "The map discards ranges at or above",
         [&](double v) { run.activity.set_max_range_m(v); });
  number("--smoothing-m", "Smoothing distance of the map",
         [&](double v) { run.activity.set_smoothing_distance_m(v); });
  number("--smoothing-scale", "Smoothing scale of the map, in [0, 1)",
         [&](double v) { run.activity.set_smoothing_scale(v); });
  number(
      "--prior-depth-m", "Depth where the global map knows nothing",
      [&](double v) { run.activity.mutable_default_prior()->set_depth_m(v); });
  number("--prior-std-m", "Its 1 sigma",
         [&](double v) { run.activity.mutable_default_prior()->set_std_m(v); });
}

void AddVehicleAndSonar(CLI::App& app, Scenario& scenario) {
  const auto number = [&](const std::string& name, double& value,
                          const std::string& help) {
    app.add_option(name, value, help)->capture_default_str();
  };
  number("--speed-m-s", scenario.vehicle.speed_m_s, "Speed over ground");
  number("--altitude-m", scenario.vehicle.altitude_m,
         "Height above the seabed");
  app.add_option("--vehicle-depth-m", scenario.vehicle.depth_m,
                 "Depth to keep where the altitude allows it");
  number("--turn-rate-deg-s", scenario.vehicle.turn_rate_deg_s, "Turn rate");
  app.add_option("--track-spacing-m", scenario.track_spacing_m,
                 "Between legs (default: from altitude and swath)");
  number("--min-water-m", scenario.min_water_m,
         "Least water that the vehicle goes over");
  number("--ping-interval-s", scenario.ping_interval_s, "Between pings");
  number("--beam-std-m", scenario.sonar.beam_std_m,
         "Noise of one beam's depth, 1 sigma");
  number("--least-std-m", scenario.sonar.least_std_m,
         "Least deviation that the sonar states");
  app.add_option("--sonar-cell-m", scenario.sonar.sonar_cell_m,
                 "Side of a sonar cell (default: --cell-m)");
  number("--sonar-range-m", scenario.sonar.fan.max_slant_range_m,
         "Longest slant range");
  app.add_option("--ships", scenario.ships, "Ships about the vehicle")
      ->capture_default_str();
  number("--crossing-m", scenario.crossing_m,
         "How near the first ship comes to the vehicle");
  number("--bearing-std-deg", scenario.passive_bearing_std_deg,
         "Bearing noise of the passive sonar, 1 sigma");
  number("--passive-range-m", scenario.passive_range_m,
         "How far it hears; 0: any distance");
  number("--report-interval-s", scenario.report_interval_s,
         "Between reports on one ship");
  number("--fix-interval-s", scenario.fix_interval_s,
         "Between C4I fixes of one ship; 0: none");
}

// The server; `without`: what happens without one.
CLI::Option* AddServer(CLI::App& app, LinkOptions& link,
                       const std::string& without) {
  const std::string tls = "TLS (PEM files; any of them: no plain text)";
  const auto file = [&](const std::string& name, std::string& path,
                        const std::string& help, const std::string& variable) {
    app.add_option(name, path, help)
        ->envname(variable)
        ->type_name("FILE")
        ->group(tls);
  };
  file("--tls-ca", link.tls.ca,
       "The authority that signed the server's certificate (default: the "
       "system's)",
       "FATHOM_TLS_CA");
  file("--tls-cert", link.tls.cert,
       "Our certificate, for servers that ask for one; with --tls-key",
       "FATHOM_TLS_CERT");
  file("--tls-key", link.tls.key, "Its private key", "FATHOM_TLS_KEY");
  return app.add_option(
      "--server", link.server,
      "host:port or unix:/path" +
          (without.empty() ? "" : " (without: " + without + ")"));
}

void AddPatience(CLI::App& app, LinkOptions& link) {
  app.add_option("--patience-s", link.patience_s,
                 "How long the server may be away, or make nothing durable, "
                 "before we give up; with --buffer: at the end alone")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 1e6));
}

// The server, how this sender is known to it, and what happens while it is
// away; the option of the server.
CLI::Option* AddLink(CLI::App& app, LinkOptions& link,
                     const std::string& without) {
  app.add_option("--source", link.source_id, "Source id of all messages")
      ->capture_default_str();
  app.add_option("--epoch", link.epoch, "Numbering epoch; 0: the wall clock");
  CLI::Option* server = AddServer(app, link, without);
  AddPatience(app, link);
  CLI::Option* buffer =
      app.add_option("--buffer", link.buffer,
                     "Keep messages in this folder until the server has them: "
                     "the run goes on while it is away, and what is left is "
                     "sent by the next run with this folder, or by `send`; a "
                     "fleet has one for each vehicle, FOLDER/ID-N")
          ->type_name("FOLDER")
          ->needs(server);
  app.add_option("--buffer-mib", link.buffer_mib,
                 "Its size for pings, and for reports. When it is full a paced "
                 "run drops what is new and counts it, one flat out waits")
      ->capture_default_str()
      ->check(CLI::Range(16, 1'000'000))
      ->needs(buffer);
  return server;
}

// Where messages go without a server.
template <typename Options>
void AddRecordFiles(CLI::App& app, Options& options, CLI::Option* server) {
  app.add_option("--pings-out", options.pings_out,
                 "Without --server: write length-delimited pings")
      ->excludes(server);
  app.add_option("--reports-out", options.reports_out,
                 "Without --server: write length-delimited reports")
      ->excludes(server);
}

void AddOut(CLI::App& app, std::string& folder) {
  app.add_option("--out", folder,
                 "Write figures (JSON), places and tracks (CSV) and pictures "
                 "of both (PNG) into this folder")
      ->type_name("FOLDER");
}

CLI::App* AddRun(CLI::App& app, RunOptions& run) {
  CLI::App* command =
      app.add_subcommand("run", "Survey an area and send what is heard");
  CLI::Option* server = AddLink(*command, run.link, "no server");
  command->add_option("--activity", run.scenario.activity_id, "Activity id")
      ->required();
  AddActivity(*command, run);
  AddTruth(*command, run.truth);
  CLI::Option* corner = AddArea(*command, run.scenario.area);
  command
      ->add_option("--auto-area", run.auto_area_side_m,
                   "Find a square of this side, metres, with water")
      ->excludes(corner);
  command->add_option("--seed", run.scenario.seed, "Seed of everything drawn")
      ->capture_default_str();
  CLI::Option* pings = command->add_option(
      "--pings", run.scenario.pings, "How many pings (default: the area once)");
  command->add_option("--duration-s", run.duration_s, "Length of the run")
      ->excludes(pings);
  AddTime(*command, "--start-time", run.start_time,
          "Time of the first ping (default: so that the run ends now)");
  command
      ->add_option("--rate", run.rate,
                   "Times real time, whatever the server does; 0: flat out")
      ->capture_default_str();
  command
      ->add_option("--prepare-mib", run.prepare_mib,
                   "Make so much of the messages (as sent; twice that in "
                   "memory; shared by --vehicles) before a vehicle's first "
                   "goes out: to load a server, not this machine's simulation")
      ->capture_default_str()
      ->check(CLI::Range(0, 16'384));
  command
      ->add_option("--vehicles", run.vehicles,
                   "So many at once, each with its own noise, its own source "
                   "and activity (ID-1, ID-2, ...)")
      ->capture_default_str()
      ->check(CLI::Range(1, kMaxVehicles));
  command->add_flag("--share-activity", run.share_activity,
                    "All vehicles survey the one activity");
  AddVehicleAndSonar(*command, run.scenario);
  command->add_option("--track-out", run.track_out, "Write the track, CSV");
  command
      ->add_option("--evaluate", run.evaluate_out,
                   "Ask the server after the run, compare with the truth, and "
                   "write figures (JSON), places and tracks (CSV) and pictures "
                   "of both (PNG) into this folder")
      ->type_name("FOLDER")
      ->needs(server);
  AddRecordFiles(*command, run, server);
  command->add_flag("--progress", run.show_progress, "Show a progress bar");
  command->add_flag("--json", run.json, "Print the survey record, one line");
  return command;
}

CLI::App* AddReplay(CLI::App& app, ReplayOptions& replay) {
  CLI::App* command = app.add_subcommand(
      "replay",
      "Send recordings: NMEA logs (own soundings, AIS), tables of soundings, "
      "beams or vessels (CSV, XYZ, GeoJSON, GeoPackage), Autoferry detections");
  command->add_option("files", replay.paths, "Recordings, gzip or not")
      ->required()
      ->type_name("FILE...");
  RecordingOptions& recording = replay.recording;
  command
      ->add_option("--format", recording.format,
                   "What the files are (default: told from their content)")
      ->check(CLI::IsMember({"nmea", "table", "autoferry"}));
  CLI::Option* server =
      AddLink(*command, replay.link, "only say what is in the files");
  command
      ->add_option("--rate", replay.rate,
                   "Times the recorded pace; 0: flat out")
      ->capture_default_str();
  command->add_flag("--from-now", replay.from_now,
                    "Shift all times so that the first is now");
  AddTime(
      *command, "--start-time", recording.start_time,
      "Time of the first line of a log that tells none; the day of one that "
      "tells times of day alone");
  command
      ->add_option("--line-interval-s", recording.line_interval_s,
                   "Between lines that tell no time")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--positive-up", recording.positive_up,
                    "The table's values are elevations");
  command->add_option("--depth-std-m", recording.depth_std_m,
                      "1 sigma of depths that come without (default: that of "
                      "IHO S-44 order 1b)");
  command->add_flag("--uncertainty-95", recording.uncertainty_95,
                    "The table's uncertainties are those of 95 %");
  command
      ->add_option("--transducer-depth-m", recording.transducer_depth_m,
                   "Depth of the transducer below the surface, added to depths "
                   "below it")
      ->capture_default_str();
  command->add_option("--water-level-m", replay.water_level_m,
                      "Depths count from the surface, which is so far above "
                      "the mission's datum (default: they count from the "
                      "datum)");
  command->add_option("--activity", replay.activity_id, "Activity id of pings")
      ->capture_default_str();
  command->add_option("--cell-m", replay.cell_size_m, "Cell of the local map")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  AddActivity(*command, replay);
  AddRecordFiles(*command, replay, server);
  command->add_flag("--progress", replay.show_progress, "Show a progress bar");
  command->add_flag("--json", replay.json, "Print what was sent, one line");
  return command;
}

CLI::App* AddScenario(CLI::App& app, ScenarioOptions& scenario) {
  CLI::App* command = app.add_subcommand(
      "scenario",
      "Run a scenario file, evaluate the map and judge it by the file's own "
      "expectations (docs/scenarios.md)");
  command->add_option("file", scenario.path, "Scenario, YAML")
      ->required()
      ->type_name("FILE");
  AddLink(*command, scenario.link, "only check the file");
  command->add_option("--seed", scenario.seed,
                      "Seed of everything drawn (default: the file's)");
  command->add_option("--rate", scenario.rate, "Times real time; 0: flat out")
      ->capture_default_str();
  command->add_flag("--progress", scenario.show_progress,
                    "Show a progress bar");
  AddOut(*command, scenario.out);
  command->add_flag("--json", scenario.json,
                    "Print survey, evaluation and what was missed, one line");
  return command;
}

CLI::App* AddEvaluate(CLI::App& app, EvaluateOptions& evaluate) {
  CLI::App* command = app.add_subcommand(
      "evaluate", "Ask the server and compare with the truth");
  AddServer(*command, evaluate.link, "")->required();
  AddTruth(*command, evaluate.truth);
  CLI::Option* corner = AddArea(*command, evaluate.area);
  command
      ->add_option("--survey", evaluate.survey_path,
                   "Survey record of run --json: area, ships, times")
      ->excludes(corner);
  AddTime(*command, "--time", evaluate.time,
          "Ask about this time (default: the survey's end, else now)");
  command->add_option("--seed", evaluate.seed, "Seed of the places")
      ->capture_default_str();
  command->add_option("--points", evaluate.points, "How many places")
      ->capture_default_str();
  AddOut(*command, evaluate.out);
  command->add_flag("--json", evaluate.json, "Print one line of JSON");
  return command;
}

CLI::App* AddSend(CLI::App& app, LinkOptions& link) {
  CLI::App* command = app.add_subcommand(
      "send",
      "Send what a run with --buffer left behind, and wait until the "
      "server has it");
  command->add_option("--buffer", link.buffer, "The run's buffer")
      ->required()
      ->type_name("FOLDER");
  AddServer(*command, link, "")->required();
  AddPatience(*command, link);
  return command;
}

struct QuestionsOptions {
  std::string survey_path;
  std::uint64_t seed = 1;
  std::uint64_t count = 1'000;
};

CLI::App* AddQuestions(CLI::App& app, QuestionsOptions& questions) {
  CLI::App* command = app.add_subcommand(
      "questions", "Print fixed questions about a survey, CSV");
  command
      ->add_option("--survey", questions.survey_path,
                   "Survey record of run --json")
      ->required();
  command->add_option("--seed", questions.seed, "Seed of the questions")
      ->capture_default_str();
  command->add_option("--count", questions.count, "How many")
      ->capture_default_str();
  return command;
}

absl::Status PrintQuestions(const QuestionsOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(const SurveyRecord survey,
                          LoadSurveyRecord(options.survey_path));
  FATHOM_ASSIGN_OR_RETURN(const std::string text,
                          MakeQuestions(survey, options.seed, options.count));
  absl::PrintF("%s", text);
  return absl::OkStatus();
}

absl::Status CheckArea(const CLI::App& command, bool has_other) {
  if (has_other || command.count("--south-west") > 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "no area: say --south-west with --north-extent-m and --east-extent-m, "
      "or let one be found (run --auto-area, evaluate --survey)");
}

int Main(int argc, char** argv) {
  CLI::App app(
      "fathom-feeder: simulated surveys and recordings for a Fathom server.\n"
      "Angles are degrees, distances metres, times RFC 3339, deviations 1 "
      "sigma.\n"
      "Example:\n"
      "  fathom-feeder run --server 127.0.0.1:7430 --activity bay --etopo \\\n"
      "    --auto-area 1000 --progress --json > survey.json\n"
      "  fathom-feeder evaluate --server 127.0.0.1:7430 --etopo --survey "
      "survey.json\n"
      "  fathom-feeder replay day.nmea --server 127.0.0.1:7430 --rate 10 "
      "--progress");
  app.require_subcommand(1);
  RunOptions run;
  // Until --sonar-cell-m is given it is the map's cell.
  run.scenario.sonar.sonar_cell_m = 0.0;
  EvaluateOptions evaluate;
  QuestionsOptions questions;
  ReplayOptions replay;
  ScenarioOptions scenario;
  LinkOptions send;
  const CLI::App* run_command = AddRun(app, run);
  const CLI::App* replay_command = AddReplay(app, replay);
  const CLI::App* scenario_command = AddScenario(app, scenario);
  const CLI::App* evaluate_command = AddEvaluate(app, evaluate);
  const CLI::App* send_command = AddSend(app, send);
  AddQuestions(app, questions);
  CLI11_PARSE(app, argc, argv);

  absl::Status status;
  if (run_command->parsed()) {
    if (run_command->count("--sonar-cell-m") == 0) {
      run.scenario.sonar.sonar_cell_m = run.scenario.area.cell_size_m;
    }
    status = CheckArea(*run_command, run.auto_area_side_m.has_value());
    if (status.ok()) status = RunSurvey(run);
  } else if (scenario_command->parsed()) {
    status = RunScenario(scenario);
  } else if (replay_command->parsed()) {
    status = Replay(replay);
  } else if (evaluate_command->parsed()) {
    status = CheckArea(*evaluate_command, !evaluate.survey_path.empty());
    if (status.ok()) status = Evaluate(evaluate);
  } else if (send_command->parsed()) {
    status = SendBuffered(send);
  } else {
    status = PrintQuestions(questions);
  }
  if (status.ok()) return 0;
  absl::FPrintF(stderr, "fathom-feeder: %s: %s\n",
                absl::StatusCodeToString(status.code()), status.message());
  return 1;
}

}  // namespace
}  // namespace fathom::feeder

int main(int argc, char** argv) { return fathom::feeder::Main(argc, argv); }
