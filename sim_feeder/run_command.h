// `fathom-feeder run`: one simulated survey, into a server or a file.

#ifndef FATHOM_SIM_FEEDER_RUN_COMMAND_H_
#define FATHOM_SIM_FEEDER_RUN_COMMAND_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "fathom/v1/mission_service.pb.h"
#include "sim_feeder/link.h"
#include "sim_feeder/message_sink.h"
#include "sim_feeder/prepared_messages.h"
#include "sim_feeder/scenario.h"
#include "sim_feeder/simulation.h"
#include "sim_feeder/survey_record.h"
#include "sim_feeder/truth_source.h"

namespace fathom::feeder {

// Vehicles of one run: each has a thread and two streams.
inline constexpr int kMaxVehicles = 100;

struct RunOptions {
  // Without a server a record file makes sense.
  LinkOptions link;

  TruthOptions truth;
  // The area; or the side of a square to be found in the truth.
  std::optional<double> auto_area_side_m;
  Scenario scenario;
  // Absent: so that the run ends now (flat out) or begins now (paced).
  std::optional<Time> start_time;
  // Length of the run; wins over scenario.pings.
  std::optional<double> duration_s;
  // Times real time; 0: flat out.
  double rate = 0.0;

  // So much of the messages, shared by the vehicles, is made before any
  // vehicle sends, MiB (prepared_messages.h); not with track_out.
  std::uint64_t prepare_mib = 0;

  // Open the activity first. Its area, cell size and id are the scenario's.
  bool start_activity = true;
  v1::ActivityParameters activity;
  std::string vehicle_id;
  // More than one: each has its own noise (seed, seed + 1, ...) and source
  // (source_id-1, ...), its own activity (id-1, ...) unless they share one.
  int vehicles = 1;
  bool share_activity = false;
  // Complete it at the end (transfer to the global map).
  bool complete_activity = false;

  std::string pings_out;
  std::string reports_out;
  std::string track_out;
  // Not empty: the server is asked after the run and its answers are compared
  // with the truth, into this folder (evaluation_files.h). One vehicle.
  std::string evaluate_out;
  bool show_progress = false;
  bool json = false;
};

// Runs, all vehicles from the same moment on, and tells people the outcome on
// standard error: one summary of all vehicles; their records in their order.
// Errors: of the scenario, the connection and the streams (the first vehicle's
// that failed); INVALID_ARGUMENT for several vehicles that would write to one
// file.
absl::StatusOr<std::vector<SurveyRecord>> PerformSurveys(
    const RunOptions& options, const TruthSource& truth);

// Runs and prints: for people on standard error, with `json` the survey record
// of each vehicle as one line on standard output.
//
// Errors: of the truth, the scenario, the connection and the streams.
absl::Status RunSurvey(const RunOptions& options);

// The part without network or files: drives `messages` into `sink` and adds
// what was sent and acknowledged to `record`. `track` (may be null) gets CSV
// lines of the vehicle's way, one per ping; nothing was made ahead then.
absl::Status DriveSurvey(PreparedMessages& messages, MessageSink& sink,
                         double rate, bool show_progress, std::ostream* track,
                         SurveyRecord& record);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_RUN_COMMAND_H_
