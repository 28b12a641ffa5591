// What a run leaves behind for those who judge or draw it: its area, its
// times, the true ways of its ships, and what the server took.
//
// As JSON, one object (`fathom-feeder run --json`). `evaluate`, `questions`
// and `fathom render` read it. Angles degrees, distances metres, times RFC
// 3339.

#ifndef FATHOM_SIM_FEEDER_SURVEY_RECORD_H_
#define FATHOM_SIM_FEEDER_SURVEY_RECORD_H_

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "sim_feeder/ship.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

struct SurveyRecord {
  std::string activity_id;
  std::string source_id;
  std::uint64_t seed = 0;
  std::string truth;
  Time start_time;
  Time end_time;
  SurveyArea area;
  std::vector<Ship> ships;

  double track_length_m = 0.0;
  double track_spacing_m = 0.0;
  // Sent: pings, measurements in them, contact reports; and pings not sent
  // because nothing returned.
  std::uint64_t pings = 0;
  std::uint64_t measurements = 0;
  std::uint64_t contact_reports = 0;
  std::uint64_t pings_silent = 0;
  // What the acks said: pings and reports that survive a power cut,
  // measurements fused; refused pings and measurements, and refused reports,
  // by reason (proto names without prefix).
  std::uint64_t pings_durable = 0;
  std::uint64_t reports_durable = 0;
  std::uint64_t measurements_accepted = 0;
  std::map<std::string, std::uint64_t> rejects;
  std::map<std::string, std::uint64_t> report_rejects;
  // Messages that found no room in the buffer while the link was down.
  std::uint64_t dropped = 0;
  std::uint64_t reconnects = 0;
  std::uint64_t map_revision = 0;
  // From the first message sent to the last one durable, seconds.
  double seconds = 0.0;
};

// One line of JSON.
std::string ToJson(const SurveyRecord& record);

// Errors: NOT_FOUND (no such file), INVALID_ARGUMENT (not such a record).
absl::StatusOr<SurveyRecord> LoadSurveyRecord(const std::string& path);

// Reads what ToJson wrote. Errors: INVALID_ARGUMENT.
absl::StatusOr<SurveyRecord> ParseSurveyRecord(const std::string& json);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SURVEY_RECORD_H_
