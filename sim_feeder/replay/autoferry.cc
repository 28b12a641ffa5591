// The Autoferry dataset (Helgesen et al. 2022) as a recording: radar
// detections about a vessel under way, as ranges and bearings.
//
// A detection has no name; it is given to the boat whose GPS place it is
// nearest to, within kOfTargetM, as the dataset's ground truth says. Places
// are metres north and east of a stated origin.

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/proto_time.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/replay/recording.h"

namespace fathom::feeder {
namespace {

using Json = nlohmann::json;

// The dataset's README: origin, and the radar's sensorID.
constexpr map::GeodeticPoint kPiren = {.latitude_deg = 63.4389029083,
                                       .longitude_deg = 10.39908278};
constexpr int kRadar = 2;
// Measured on the dataset itself: 1 sigma of the radar.
constexpr double kRangeStdM = 4.9;
constexpr double kBearingStdDeg = 5.2;
constexpr double kOfTargetM = 40;

absl::StatusOr<Json> Load(const std::string& path) {
  std::ifstream file(path);
  if (!file) return absl::NotFoundError(absl::StrFormat("no file %s", path));
  Json json = Json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!json.is_array()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s is no list of detections", path));
  }
  return json;
}

std::optional<std::array<double, 2>> PairOf(const Json& value) {
  if (!value.is_array() || value.size() < 2 || !value[0].is_number() ||
      !value[1].is_number()) {
    return std::nullopt;
  }
  return std::array{value[0].get<double>(), value[1].get<double>()};
}

// North and east of each detection: two numbers, or two lists.
std::vector<std::array<double, 2>> DetectionsOf(const Json& measured) {
  std::vector<std::array<double, 2>> places;
  if (const auto one = PairOf(measured)) return {*one};
  if (!measured.is_array() || measured.size() != 2 || !measured[0].is_array() ||
      measured[0].size() != measured[1].size()) {
    return {};
  }
  for (std::size_t n = 0; n < measured[0].size(); ++n) {
    if (!measured[0][n].is_number() || !measured[1][n].is_number()) continue;
    places.push_back(
        {measured[0][n].get<double>(), measured[1][n].get<double>()});
  }
  return places;
}

class Autoferry final : public Recording {
 public:
  Autoferry(Json detections, Json truths, std::string name)
      : detections_(std::move(detections)),
        truths_(std::move(truths)),
        name_(std::move(name)),
        frame_(kPiren) {}

  absl::StatusOr<std::optional<RecordedEvent>> Next() override {
    while (waiting_.empty()) {
      if (done_ == detections_.size()) return std::optional<RecordedEvent>();
      TakeScan(detections_[done_], truths_[done_]);
      ++done_;
    }
    RecordedEvent event = std::move(waiting_.back());
    waiting_.pop_back();
    return event;
  }

 private:
  void TakeScan(const Json& scan, const Json& truths) {
    if (scan.value("sensorID", 0) != kRadar) {
      PassOver("other sensor");
      return;
    }
    const auto own = PairOf(scan.value("ownshipPosition", Json()));
    const double time_s = scan.value("time", 0.0);
    if (!own.has_value() || !(time_s > 0 && time_s < 1e10) ||
        !truths.is_array()) {
      PassOver("bad scan");
      return;
    }
    const Time time{Duration(std::llround(1e6 * time_s))};
    const std::vector<std::array<double, 2>> seen =
        DetectionsOf(scan.value("measurement", Json()));
    std::vector<bool> used(seen.size(), false);
    for (const Json& truth : truths) {
      const auto there = PairOf(truth.value("position", Json()));
      if (!there.has_value()) continue;
      std::size_t nearest = seen.size();
      double off_m = kOfTargetM;
      for (std::size_t n = 0; n < seen.size(); ++n) {
        const double away_m = std::hypot(seen[n][0] + (*own)[0] - (*there)[0],
                                         seen[n][1] + (*own)[1] - (*there)[1]);
        if (away_m <= off_m) {
          off_m = away_m;
          nearest = n;
        }
      }
      if (nearest == seen.size()) continue;
      used[nearest] = true;
      waiting_.push_back({.time = time,
                          .what = Report(*own, seen[nearest],
                                         truth.value("targetID", 0), time)});
    }
    for (const bool taken : used) {
      if (!taken) PassOver("detection of no known boat");
    }
  }

  v1::ContactReport Report(const std::array<double, 2>& own,
                           const std::array<double, 2>& seen, int target,
                           Time time) const {
    v1::ContactReport report;
    report.set_contact_id(absl::StrFormat("%s.%d", name_, target));
    report.set_contact_class(v1::CONTACT_CLASS_SMALL_CRAFT);
    *report.mutable_time() = client::ToProto(time);
    v1::RangeBearing& observation = *report.mutable_range_bearing();
    const map::GeodeticPoint place = frame_.ToGeodetic(own[0], own[1]);
    v1::GeodeticPoint& position =
        *observation.mutable_pose()->mutable_position();
    position.set_latitude_deg(place.latitude_deg);
    position.set_longitude_deg(place.longitude_deg);
    observation.set_range_m(std::hypot(seen[0], seen[1]));
    observation.set_bearing_deg(std::atan2(seen[1], seen[0]) *
                                kDegreesPerRadian);
    observation.set_range_std_m(kRangeStdM);
    observation.set_bearing_std_deg(kBearingStdDeg);
    return report;
  }

  const Json detections_;
  const Json truths_;
  const std::string name_;
  const map::NedFrame frame_;
  std::size_t done_ = 0;
  // Of the scan read last.
  std::vector<RecordedEvent> waiting_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenAutoferry(
    const std::string& path, const RecordingOptions& /*options*/) {
  constexpr std::string_view kDetections = "_detections.json";
  if (!path.ends_with(kDetections)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: the name of an Autoferry recording ends with %s, and the file of "
        "ground truth stands beside it",
        path, kDetections));
  }
  const std::string stem = path.substr(0, path.size() - kDetections.size());
  FATHOM_ASSIGN_OR_RETURN(Json detections, Load(path));
  FATHOM_ASSIGN_OR_RETURN(Json truths, Load(stem + "_groundTruth.json"));
  if (detections.size() != truths.size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s holds %d scans, its ground truth %d", path,
                        detections.size(), truths.size()));
  }
  return std::make_unique<Autoferry>(std::move(detections), std::move(truths),
                                     stem.substr(stem.rfind('/') + 1));
}

}  // namespace fathom::feeder
