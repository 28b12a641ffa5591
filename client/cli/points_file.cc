#include "client/cli/points_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

enum Column { kLatitude, kLongitude, kDepth, kTime, kColumns };

// Accepted names of each column.
constexpr std::array<std::array<const char*, 3>, kColumns> kNames = {{
    {"latitude_deg", "latitude", "lat"},
    {"longitude_deg", "longitude", "lon"},
    {"depth_m", "depth", "z"},
    {"time", "time_utc", "timestamp"},
}};

constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);
using Order = std::array<std::size_t, kColumns>;

absl::Status BadFile(const std::string& message) {
  return FileError(absl::InvalidArgumentError(message));
}

absl::StatusOr<Order> ReadHeader(const std::vector<std::string>& fields) {
  Order order;
  order.fill(kAbsent);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    for (std::size_t column = 0; column < kColumns; ++column) {
      const auto& names = kNames[column];
      if (std::find(names.begin(), names.end(), fields[i]) != names.end()) {
        order[column] = i;
      }
    }
  }
  if (order[kLatitude] == kAbsent || order[kLongitude] == kAbsent) {
    return BadFile(
        "line 1: neither numbers nor a header with latitude_deg and "
        "longitude_deg");
  }
  return order;
}

// Calls `take` with the fields of each line of points and the columns' order.
template <typename Take>
absl::Status ForEachLine(std::istream& in, const Take& take) {
  Order order = {0, 1, 2, 3};
  std::string line;
  bool first = true;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    const std::vector<std::string> fields = SplitList(line, ',');
    if ((fields.size() == 1 && fields[0].empty()) || line.starts_with('#')) {
      continue;
    }
    if (std::exchange(first, false) && !ParseNumber(fields[0]).ok()) {
      FATHOM_ASSIGN_OR_RETURN(order, ReadHeader(fields));
      continue;
    }
    const absl::Status taken = take(fields, order);
    if (!taken.ok()) {
      return BadFile(
          absl::StrFormat("line %d: %s", number, std::string(taken.message())));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::GeodeticPoint> ReadPlace(
    const std::vector<std::string>& fields, const Order& order) {
  if (order[kLatitude] >= fields.size() || order[kLongitude] >= fields.size()) {
    return absl::InvalidArgumentError("latitude or longitude is missing");
  }
  return ParsePoint(fields[order[kLatitude]] + "," + fields[order[kLongitude]]);
}

absl::StatusOr<QuestionPoint> ReadPoint(const std::vector<std::string>& fields,
                                        const Order& order,
                                        std::optional<double> default_depth_m,
                                        Time now) {
  const auto field = [&](Column column) {
    return order[column] < fields.size() ? fields[order[column]]
                                         : std::string();
  };
  QuestionPoint point;
  FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint position,
                          ReadPlace(fields, order));
  point.latitude_deg = position.latitude_deg();
  point.longitude_deg = position.longitude_deg();
  if (!field(kDepth).empty()) {
    FATHOM_ASSIGN_OR_RETURN(point.depth_m, ParseNumber(field(kDepth)));
  } else if (default_depth_m.has_value()) {
    point.depth_m = *default_depth_m;
  } else {
    return absl::InvalidArgumentError(
        "no depth: add a depth_m column or say --depth-m");
  }
  if (!field(kTime).empty()) {
    FATHOM_ASSIGN_OR_RETURN(point.time, ParseMoment(field(kTime), now));
  }
  return point;
}

nlohmann::ordered_json NumberOrNull(float value) {
  if (!std::isfinite(value)) return nullptr;
  return value;
}

}  // namespace

absl::StatusOr<std::vector<QuestionPoint>> ReadPoints(
    std::istream& in, std::optional<double> default_depth_m, Time now) {
  std::vector<QuestionPoint> points;
  FATHOM_RETURN_IF_ERROR(ForEachLine(
      in,
      [&](const std::vector<std::string>& fields,
          const Order& order) -> absl::Status {
        FATHOM_ASSIGN_OR_RETURN(QuestionPoint point,
                                ReadPoint(fields, order, default_depth_m, now));
        if (points.size() == kMaxPoints) {
          return absl::InvalidArgumentError(
              absl::StrFormat("more than %d points", kMaxPoints));
        }
        points.push_back(point);
        return absl::OkStatus();
      }));
  if (points.empty()) return BadFile("no point in it");
  return points;
}

absl::StatusOr<std::vector<QuestionPoint>> ReadPoints(
    const std::string& path, std::optional<double> default_depth_m, Time now) {
  if (path == "-") return ReadPoints(std::cin, default_depth_m, now);
  std::ifstream in(path);
  if (!in) {
    return FileError(
        absl::NotFoundError(absl::StrFormat("%s: cannot be opened", path)));
  }
  absl::StatusOr<std::vector<QuestionPoint>> points =
      ReadPoints(in, default_depth_m, now);
  if (!points.ok()) {
    return BadFile(absl::StrFormat("%s: %s", path,
                                   std::string(points.status().message())));
  }
  return points;
}

absl::StatusOr<std::vector<v1::GeodeticPoint>> ReadPlaces(
    const std::string& path) {
  std::ifstream in(path);
  if (!in) {
    return FileError(
        absl::NotFoundError(absl::StrFormat("%s: cannot be opened", path)));
  }
  std::vector<v1::GeodeticPoint> places;
  const absl::Status read =
      ForEachLine(in,
                  [&](const std::vector<std::string>& fields,
                      const Order& order) -> absl::Status {
                    FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint place,
                                            ReadPlace(fields, order));
                    places.push_back(place);
                    return absl::OkStatus();
                  });
  if (!read.ok()) {
    return BadFile(
        absl::StrFormat("%s: %s", path, std::string(read.message())));
  }
  return places;
}

nlohmann::ordered_json AnswersJson(const std::vector<QuestionPoint>& points,
                                   const PointAnswers& answers) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < points.size(); ++i) {
    nlohmann::ordered_json answer;
    answer["latitude_deg"] = points[i].latitude_deg;
    answer["longitude_deg"] = points[i].longitude_deg;
    answer["depth_m"] = points[i].depth_m;
    if (points[i].time.has_value()) {
      answer["time"] = FormatTime(*points[i].time);
    }
    answer["state"] = v1::ObstacleState_Name(answers.state[i]);
    answer["probability"] = NumberOrNull(answers.probability[i]);
    answer["mean_depth_m"] = NumberOrNull(answers.mean_depth_m[i]);
    answer["std_m"] = NumberOrNull(answers.std_m[i]);
    answer["age_s"] = NumberOrNull(answers.age_s[i]);
    answer["kind"] = v1::EvidenceKind_Name(answers.kind[i]);
    list.push_back(std::move(answer));
  }
  return {{"answers", std::move(list)}, {"stamp", ToJson(answers.stamp)}};
}

std::string AnswersCsv(const std::vector<QuestionPoint>& points,
                       const PointAnswers& answers) {
  const auto number = [](float value) {
    return std::isfinite(value) ? absl::StrFormat("%.6g", value)
                                : std::string();
  };
  std::string text =
      "latitude_deg,longitude_deg,depth_m,time,state,probability,"
      "mean_depth_m,std_m,age_s,kind\n";
  for (std::size_t i = 0; i < points.size(); ++i) {
    const QuestionPoint& point = points[i];
    absl::StrAppendFormat(
        &text, "%.8f,%.8f,%.6g,%s,%s,%s,%s,%s,%s,%s\n", point.latitude_deg,
        point.longitude_deg, point.depth_m,
        point.time.has_value() ? FormatTime(*point.time) : "",
        StateText(answers.state[i]), number(answers.probability[i]),
        number(answers.mean_depth_m[i]), number(answers.std_m[i]),
        number(answers.age_s[i]), KindText(answers.kind[i]));
  }
  return text;
}

}  // namespace fathom::client::cli
