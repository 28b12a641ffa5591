// A recorded multibeam survey: RecordedFigures.

#include <cpl_conv.h>
#include <cpl_string.h>
#include <cpl_vsi.h>

#include <cmath>
#include <cstdlib>
#include <numbers>

#include "tests/accuracy/figures.h"
#include "tests/accuracy/survey.h"

namespace fathom::accuracy {
namespace {

struct Recorded {
  bool odd = false;  // Of the pings in order.
  Sounding sounding;
};

// Column numbers of the table.
enum Column { kPing = 1, kLat, kLon, kHeading, kAcross = 12, kDepth, kQuality };

// What such an echo sounder is taken to be good for: 0.1 m and 0.5 % of depth.
double StatedStdM(double depth_m) { return std::hypot(0.1, 0.005 * depth_m); }

std::vector<Recorded> ReadSoundings(const std::string& path) {
  std::vector<Recorded> soundings;
  VSILFILE* file = VSIFOpenL(("/vsigzip/" + path).c_str(), "rb");
  if (file == nullptr) return soundings;
  constexpr double kRadPerDeg = std::numbers::pi / 180;
  constexpr double kMetresPerDegree = 111'000;
  std::string last_ping;
  bool odd = false;
  double origin_lat = 0;
  double origin_lon = 0;
  CPLReadLineL(file);  // Names.
  while (const char* line = CPLReadLineL(file)) {
    const CPLStringList fields(CSLTokenizeString2(line, ",", 0));
    if (fields.size() <= kQuality) continue;
    // Both quality bits: brightness and colinearity passed.
    if ((std::atoi(fields[kQuality]) & 3) != 3) continue;
    const double lat = std::atof(fields[kLat]);
    const double lon = std::atof(fields[kLon]);
    if (soundings.empty()) {
      origin_lat = lat - 0.002;
      origin_lon = lon - 0.002;
    }
    if (last_ping != fields[kPing]) {
      last_ping = fields[kPing];
      odd = !odd;
    }
    const double heading = std::atof(fields[kHeading]) * kRadPerDeg;
    const double across_m = std::atof(fields[kAcross]);
    const double depth_m = std::atof(fields[kDepth]);
    soundings.push_back(
        {.odd = odd,
         .sounding = {
             .place = {.north_m = (lat - origin_lat) * kMetresPerDegree -
                                  across_m * std::sin(heading),
                       .east_m = (lon - origin_lon) * kMetresPerDegree *
                                     std::cos(lat * kRadPerDeg) +
                                 across_m * std::cos(heading)},
             .depth_m = depth_m,
             .std_m = StatedStdM(depth_m)}});
  }
  VSIFCloseL(file);
  return soundings;
}

}  // namespace

nlohmann::json RecordedFigures(const std::string& soundings_csv_gz) {
  auto rows = nlohmann::json::array();
  const std::vector<Recorded> soundings = ReadSoundings(soundings_csv_gz);
  if (soundings.empty()) return rows;
  for (const double cell_m : {1.0, 2.0, 5.0}) {
    const Window window{.cell_m = cell_m,
                        .cells = static_cast<int>(450 / cell_m)};
    map::LocalMap map = MakeMap(window, SurveyPlan{});
    std::vector<Sounding> fused;
    for (const Recorded& recorded : soundings) {
      if (recorded.odd) fused.push_back(recorded.sounding);
    }
    const std::uint32_t accepted = Feed(fused, nullptr, map);
    const map::LocalMapView view = map.View();
    double within[3] = {};
    double square = 0;
    double square_m2 = 0;
    double count = 0;
    for (const Recorded& recorded : soundings) {
      if (recorded.odd) continue;
      const Sounding& sounding = recorded.sounding;
      const auto estimate =
          view.AtCell({.i = static_cast<std::int32_t>(
                           std::floor(sounding.place.north_m / cell_m)),
                       .j = static_cast<std::int32_t>(
                           std::floor(sounding.place.east_m / cell_m))});
      if (!estimate) continue;
      // The verifying sounding has noise of its own.
      const double std_m = std::hypot(estimate->std_m, sounding.std_m);
      const double error_m = sounding.depth_m - estimate->depth_m;
      for (int k = 0; k < 3; ++k) {
        within[k] += std::abs(error_m) <= (k + 1) * std_m;
      }
      square += error_m * error_m / (std_m * std_m);
      square_m2 += error_m * error_m;
      count += 1;
    }
    rows.push_back(
        {{"cell_m", cell_m},
         {"fused", accepted},
         {"verified", count},
         {"hits_per_cell", static_cast<double>(accepted) /
                               static_cast<double>(view.cells_measured())},
         {"rmse_m", std::sqrt(square_m2 / count)},
         {"normalised_square", square / count},
         {"within_1std_percent", 100 * within[0] / count},
         {"within_2std_percent", 100 * within[1] / count},
         {"within_3std_percent", 100 * within[2] / count}});
  }
  return rows;
}

}  // namespace fathom::accuracy
