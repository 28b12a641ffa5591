#include "client/cli/trajectory_file.h"

#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"

namespace fathom::client::cli {
namespace {

using nlohmann::json;

// A plan of 10 000 waypoints is below 2 MB.
constexpr std::size_t kMaxFileBytes = std::size_t{64} << 20;

absl::Status BadFile(const std::string& message) {
  return FileError(absl::InvalidArgumentError(message));
}

// The member, or null.
const json* Member(const json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(name);
  return found == object.end() ? nullptr : &*found;
}

bool HasType(const json& object, const char* type) {
  const json* found = Member(object, "type");
  return found != nullptr && found->is_string() && *found == type;
}

absl::StatusOr<QuestionPoint> ParseCoordinate(const json& coordinate,
                                              std::size_t i,
                                              std::optional<double> depth_m) {
  const auto bad = [i](const char* what) {
    return BadFile(absl::StrFormat("coordinates[%u]: %s", i, what));
  };
  if (!coordinate.is_array() || coordinate.size() < 2 ||
      coordinate.size() > 3) {
    return bad("is not [longitude, latitude] or [longitude, latitude, height]");
  }
  for (const json& number : coordinate) {
    if (!number.is_number()) return bad("holds something that is no number");
  }
  QuestionPoint point;
  point.longitude_deg = coordinate[0].get<double>();
  point.latitude_deg = coordinate[1].get<double>();
  if (!(std::abs(point.latitude_deg) <= 90 &&
        std::abs(point.longitude_deg) <= 180)) {
    return bad("lies outside [-180, 180], [-90, 90]; longitude comes first");
  }
  if (coordinate.size() == 3) {
    point.depth_m = -coordinate[2].get<double>();
  } else if (depth_m.has_value()) {
    point.depth_m = *depth_m;
  } else {
    return bad("no depth: add a height (minus the depth) or say --depth-m");
  }
  return point;
}

absl::StatusOr<std::vector<QuestionPoint>> ParseGeoJson(
    const std::string& text, const TrajectoryDefaults& defaults) {
  const json document = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) return BadFile("is not valid JSON");
  const json* feature = &document;
  if (HasType(document, "FeatureCollection")) {
    const json* features = Member(document, "features");
    if (features == nullptr || !features->is_array() || features->empty()) {
      return BadFile("a FeatureCollection without features");
    }
    feature = &features->front();
  }
  const json* line = feature;
  const json* times = nullptr;
  if (HasType(*feature, "Feature")) {
    line = Member(*feature, "geometry");
    if (const json* properties = Member(*feature, "properties")) {
      times = Member(*properties, "times");
      if (times == nullptr) times = Member(*properties, "coordTimes");
    }
  }
  const json* coordinates = line != nullptr && HasType(*line, "LineString")
                                ? Member(*line, "coordinates")
                                : nullptr;
  if (coordinates == nullptr || !coordinates->is_array()) {
    return BadFile(
        "no LineString in it: a trajectory is one LineString, alone or as a "
        "Feature's geometry");
  }
  if (times != nullptr &&
      (!times->is_array() || times->size() != coordinates->size())) {
    return BadFile("\"times\" must be a list, one time for each coordinate");
  }
  std::vector<QuestionPoint> points;
  for (std::size_t i = 0; i < coordinates->size(); ++i) {
    FATHOM_ASSIGN_OR_RETURN(
        QuestionPoint point,
        ParseCoordinate((*coordinates)[i], i, defaults.depth_m));
    if (times != nullptr) {
      const json& time = (*times)[i];
      const auto moment =
          time.is_string() ? ParseMoment(time.get<std::string>(), defaults.now)
                           : absl::InvalidArgumentError("is not text");
      if (!moment.ok()) {
        return BadFile(absl::StrFormat("times[%u]: %s", i,
                                       std::string(moment.status().message())));
      }
      point.time = *moment;
    }
    points.push_back(point);
  }
  return points;
}

// Length of a leg, metres; good to 1 % for legs of 100 km.
double LengthM(const QuestionPoint& a, const QuestionPoint& b) {
  const MetersPerDegree metres =
      MetersPerDegreeAt(0.5 * (a.latitude_deg + b.latitude_deg));
  return std::hypot(
      metres.latitude * (b.latitude_deg - a.latitude_deg),
      metres.longitude * WrapLongitude(b.longitude_deg - a.longitude_deg));
}

absl::Status FillTimes(const TrajectoryDefaults& defaults,
                       std::vector<QuestionPoint>& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].time.has_value()) continue;
    if (i == 0) {
      points[i].time = defaults.start;
      continue;
    }
    if (!defaults.speed_m_s.has_value()) {
      return BadFile(absl::StrFormat(
          "waypoint %u has no time: add a time column (or \"times\") or say "
          "--speed-m-s",
          i));
    }
    const std::chrono::duration<double> takes(
        LengthM(points[i - 1], points[i]) / *defaults.speed_m_s);
    points[i].time = *points[i - 1].time +
                     std::chrono::ceil<std::chrono::microseconds>(takes);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadAll(std::istream& in) {
  std::string text;
  std::vector<char> part(1 << 16);
  while (in.read(part.data(), static_cast<std::streamsize>(part.size())) ||
         in.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
    if (text.size() > kMaxFileBytes) {
      return absl::InvalidArgumentError("larger than 64 MiB: no trajectory");
    }
  }
  return text;
}

}  // namespace

absl::StatusOr<std::vector<QuestionPoint>> ParseTrajectory(
    const std::string& text, const TrajectoryDefaults& defaults) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  std::vector<QuestionPoint> points;
  if (first != std::string::npos && text[first] == '{') {
    FATHOM_ASSIGN_OR_RETURN(points, ParseGeoJson(text, defaults));
  } else {
    std::istringstream in(text);
    FATHOM_ASSIGN_OR_RETURN(points,
                            ReadPoints(in, defaults.depth_m, defaults.now));
  }
  if (points.size() < 2) {
    return BadFile("a trajectory has at least 2 waypoints");
  }
  FATHOM_RETURN_IF_ERROR(FillTimes(defaults, points));
  return points;
}

absl::StatusOr<std::vector<QuestionPoint>> ReadTrajectory(
    const std::string& path, const TrajectoryDefaults& defaults) {
  absl::StatusOr<std::string> text;
  if (path == "-") {
    text = ReadAll(std::cin);
  } else {
    std::ifstream in(path, std::ios::binary);
    if (!in) {
      return FileError(
          absl::NotFoundError(absl::StrFormat("%s: cannot be opened", path)));
    }
    text = ReadAll(in);
  }
  if (!text.ok()) {
    return BadFile(
        absl::StrFormat("%s: %s", path, std::string(text.status().message())));
  }
  absl::StatusOr<std::vector<QuestionPoint>> points =
      ParseTrajectory(*text, defaults);
  if (!points.ok()) {
    return BadFile(absl::StrFormat("%s: %s", path,
                                   std::string(points.status().message())));
  }
  return points;
}

}  // namespace fathom::client::cli
