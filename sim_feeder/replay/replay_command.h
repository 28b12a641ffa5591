// `fathom-feeder replay`: recordings of real days at sea into a live server.

#ifndef FATHOM_SIM_FEEDER_REPLAY_REPLAY_COMMAND_H_
#define FATHOM_SIM_FEEDER_REPLAY_REPLAY_COMMAND_H_

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "fathom/v1/mission_service.pb.h"
#include "sim_feeder/link.h"
#include "sim_feeder/message_sink.h"
#include "sim_feeder/replay/recording.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

struct ReplayOptions {
  // Read one after the other, in this order.
  std::vector<std::string> paths = {};
  RecordingOptions recording = {};

  // Without a server: a dry run, to see what is in the files.
  LinkOptions link = {.source_id = "replay"};
  // Times the recorded pace; 0: flat out.
  double rate = 0;
  // Recorded times are shifted so that the first event is now. Needs a rate
  // in (0, 1]: else it would tell of the future.
  bool from_now = false;
  // Water surface above the mission's datum, metres: depths count from the
  // surface. Absent: they count from the datum.
  std::optional<double> water_level_m = {};

  // The activity that pings belong to. Its area is what the soundings cover,
  // unless it is open already.
  std::string activity_id = "replay";
  std::string vehicle_id = {};
  bool start_activity = true;
  bool complete_activity = false;
  double cell_size_m = 10;
  v1::ActivityParameters activity = {};

  // Without server: where messages go, as RecordSink.
  std::string pings_out = {};
  std::string reports_out = {};
  bool show_progress = false;
  bool json = false;
};

// What recordings hold, from reading them through.
struct ReplayContents {
  std::uint64_t soundings = 0;
  std::uint64_t pings = 0;  // Recorded as such, and those made of soundings.
  std::uint64_t reports = 0;
  std::uint64_t contacts = 0;
  // Absent: no event.
  std::optional<Time> first = {};
  std::optional<Time> last = {};
  // What soundings and beams cover, two cells more on each side; absent: none.
  std::optional<SurveyArea> area = {};
  // Lines and rows passed over, by reason.
  std::map<std::string, std::uint64_t> passed_over = {};

  std::uint64_t messages() const { return pings + reports; }
};

// Reads all files through. Errors: as OpenRecording and Recording::Next, each
// naming the file.
absl::StatusOr<ReplayContents> SurveyRecordings(const ReplayOptions& options);

// Reads them again and sends every message to `sink`, paced; ends with
// sink.Finish(). Errors: as SurveyRecordings, and the sink's.
absl::Status DriveReplay(const ReplayOptions& options,
                         const ReplayContents& contents, MessageSink& sink);

// All of it, as the command line has it; prints like `run`. Errors: as above;
// INVALID_ARGUMENT if the recordings hold nothing that can be sent (named by
// reason) or the options make no sense; those of the connection.
absl::Status Replay(const ReplayOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_REPLAY_COMMAND_H_
