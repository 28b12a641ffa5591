// Many questions at once: from a CSV file, and their answers for people and
// scripts.

#ifndef FATHOM_CLIENT_CLI_POINTS_FILE_H_
#define FATHOM_CLIENT_CLI_POINTS_FILE_H_

#include <istream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "client/point_questions.h"

namespace fathom::client::cli {

// Most points taken from one file: 200 MB of answers.
inline constexpr std::size_t kMaxPoints = 5'000'000;

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

// {"answers": [{latitude_deg, ..., state, probability, ...}], "stamp": {}}.
nlohmann::ordered_json AnswersJson(const std::vector<QuestionPoint>& points,
                                   const PointAnswers& answers);
// One line a point under a header line.
std::string AnswersCsv(const std::vector<QuestionPoint>& points,
                       const PointAnswers& answers);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_POINTS_FILE_H_
