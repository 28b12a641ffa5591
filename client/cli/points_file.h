// Many questions at once: from a CSV file to QueryObstacles and back.

#ifndef FATHOM_CLIENT_CLI_POINTS_FILE_H_
#define FATHOM_CLIENT_CLI_POINTS_FILE_H_

#include <istream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/client.h"

namespace fathom::client::cli {

// Most points taken from one file: 200 MB of answers.
inline constexpr std::size_t kMaxPoints = 5'000'000;

struct QuestionPoint {
  double latitude_deg = 0;
  double longitude_deg = 0;
  double depth_m = 0;
  // Absent: the time asked for all.
  std::optional<Time> time;
};

// Answers in the order of the questions, from one revision of the map.
struct PointAnswers {
  std::vector<float> probability;
  std::vector<v1::ObstacleState> state;
  std::vector<float> mean_depth_m;  // NaN: unknown.
  std::vector<float> std_m;         // NaN: unknown.
  std::vector<float> age_s;         // NaN: unknown.
  std::vector<v1::EvidenceKind> kind;
  // Of the first part; later parts may be newer when others write.
  v1::MapStamp stamp;
};

// Reads points from a CSV stream: latitude_deg, longitude_deg, depth_m and
// optionally time. A first line that is not numbers names the columns; blank
// lines and lines that begin with # are skipped. Points without a depth get
// `default_depth_m`. Errors: INVALID_ARGUMENT naming line and column, marked
// as the file's fault.
absl::StatusOr<std::vector<QuestionPoint>> ReadPoints(
    std::istream& in, std::optional<double> default_depth_m, Time now);
// The same from a path, or from standard input for "-". Also NOT_FOUND.
absl::StatusOr<std::vector<QuestionPoint>> ReadPoints(
    const std::string& path, std::optional<double> default_depth_m, Time now);

// Places alone, such as a vehicle's way: latitude_deg and longitude_deg from
// the same kind of file; other columns are not looked at.
absl::StatusOr<std::vector<v1::GeodeticPoint>> ReadPlaces(
    const std::string& path);

// Asks in parts of at most Limits.max_points_per_query. `common` holds what
// all share; `time` is for points without their own (absent: now).
absl::StatusOr<PointAnswers> AskPoints(const Client& client,
                                       const v1::QueryObstaclesRequest& common,
                                       const std::vector<QuestionPoint>& points,
                                       std::optional<Time> time);

// {"answers": [{latitude_deg, ..., state, probability, ...}], "stamp": {}}.
nlohmann::ordered_json AnswersJson(const std::vector<QuestionPoint>& points,
                                   const PointAnswers& answers);
// One line a point under a header line.
std::string AnswersCsv(const std::vector<QuestionPoint>& points,
                       const PointAnswers& answers);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_POINTS_FILE_H_
