// bench_peers: one stream of soundings into our local map, OctoMap (Hornung
// et al. 2013, doi:10.1007/s10514-012-9321-0) and OpenVDB (Museth 2013,
// doi:10.1145/2487228.2487235), cells and voxels of 1 m; prints JSON.
//
// Each does the least that makes it answer "is it solid there": ours fuses
// depth and std and publishes a view every 64 pings; the others raise the
// log-odds of the voxel that was hit and carve no free space (OctoMap's
// insertRay would cost it tens of voxels a beam). Ours stores one depth a
// column and the others volumes, so bytes are not like for like: a height
// field cannot hold an overhang.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/local/local_map.h"

#ifdef FATHOM_HAVE_OCTOMAP
#include <octomap/OcTree.h>
#endif
#ifdef FATHOM_HAVE_OPENVDB
#include <openvdb/openvdb.h>
#endif

namespace fathom::map {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kPings = 2048;
constexpr std::size_t kPingsPerView = 64;
constexpr std::size_t kQueries = 1 << 16;
constexpr int kRounds = 5;
// Log-odds of a hit with probability 0.7, OctoMap's default.
constexpr float kHit = 0.85f;

// The track of bench_local: 101 beams over 150 degrees, 20 to 100 m.
struct Scene {
  LocalMapOptions options;
  std::vector<Ping> pings;
  // The same soundings as points: north, east, depth.
  std::vector<NedPoint> points;
  // Points of soundings, shuffled: what is asked.
  std::vector<std::pair<GeodeticPoint, NedPoint>> queries;
  double square_km = 0;
};

Scene MakeScene() {
  Scene scene;
  LocalMapOptions& options = scene.options;
  options.south_west = {41.5, -71.3};
  options.north_extent_m = 1000.0;
  options.east_extent_m = 1000.0;
  options.cell_size_m = 1.0;
  std::mt19937 random(2002);
  std::uniform_real_distribution<float> range_m(20.0f, 100.0f);
  std::normal_distribution<float> noise;
  const NedFrame frame(options.south_west);
  std::set<std::pair<int, int>> cells;
  for (std::size_t k = 0; k < kPings; ++k) {
    const double north_m = 200.0 + 0.25 * static_cast<double>(k);
    Ping& ping = scene.pings.emplace_back();
    ping.time = Time(std::chrono::milliseconds(250 * k));
    ping.pose.position = frame.ToGeodetic(north_m, 500.0);
    for (int beam = -50; beam <= 50; ++beam) {
      const Beam& b = ping.beams.emplace_back(
          Beam{.range_m = range_m(random),
               .bearing_rad = 0.0261799f * static_cast<float>(beam),
               .depth_m = 25.0f + 0.3f * noise(random),
               .std_m = 0.3f});
      const double azimuth = static_cast<double>(b.bearing_rad);
      const double range = static_cast<double>(b.range_m);
      const NedPoint& point = scene.points.emplace_back(
          NedPoint{.north_m = north_m + range * std::cos(azimuth),
                   .east_m = 500.0 + range * std::sin(azimuth),
                   .down_m = static_cast<double>(b.depth_m)});
      cells.emplace(static_cast<int>(point.north_m),
                    static_cast<int>(point.east_m));
    }
  }
  scene.square_km = static_cast<double>(cells.size()) * 1e-6;
  std::uniform_int_distribution<std::size_t> pick(0, scene.points.size() - 1);
  for (std::size_t i = 0; i < kQueries; ++i) {
    const NedPoint& point = scene.points[pick(random)];
    scene.queries.emplace_back(frame.ToGeodetic(point.north_m, point.east_m),
                               point);
  }
  return scene;
}

double SecondsOf(const auto& work) {
  const auto start = SteadyClock::now();
  work();
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

struct Figures {
  double update_s = 1e9;
  double query_s = 1e9;
  double bytes = 0;
  double found = 0;
};

// Best of the rounds: the machine's other work only ever adds.
void Keep(Figures& best, const Figures& now) {
  best.update_s = std::min(best.update_s, now.update_s);
  best.query_s = std::min(best.query_s, now.query_s);
  best.bytes = now.bytes;
  best.found = now.found;
}

Figures Ours(const Scene& scene) {
  Figures figures;
  LocalMap map = *LocalMap::Create(scene.options);
  LocalMapView view;
  figures.update_s = SecondsOf([&] {
    for (std::size_t k = 0; k < scene.pings.size(); ++k) {
      map.Update(scene.pings[k], nullptr);
      if ((k + 1) % kPingsPerView == 0) view = map.View();
    }
  });
  figures.query_s = SecondsOf([&] {
    for (const auto& [place, point] : scene.queries) {
      figures.found += view.At(place).has_value();
    }
  });
  figures.bytes = static_cast<double>(view.memory_bytes());
  return figures;
}

#ifdef FATHOM_HAVE_OCTOMAP
octomap::point3d ToOctomap(const NedPoint& point) {
  return {static_cast<float>(point.north_m), static_cast<float>(point.east_m),
          static_cast<float>(-point.down_m)};
}

Figures OctoMap(const Scene& scene) {
  Figures figures;
  octomap::OcTree tree(1.0);
  figures.update_s = SecondsOf([&] {
    for (const NedPoint& point : scene.points) {
      tree.updateNode(ToOctomap(point), /*occupied=*/true,
                      /*lazy_eval=*/true);
    }
    tree.updateInnerOccupancy();
  });
  figures.query_s = SecondsOf([&] {
    for (const auto& [place, point] : scene.queries) {
      const auto* node = tree.search(ToOctomap(point));
      figures.found += node != nullptr && tree.isNodeOccupied(node);
    }
  });
  figures.bytes = static_cast<double>(tree.memoryUsage());
  return figures;
}
#endif

#ifdef FATHOM_HAVE_OPENVDB
openvdb::Coord ToVdb(const NedPoint& point) {
  return {static_cast<int>(std::floor(point.north_m)),
          static_cast<int>(std::floor(point.east_m)),
          static_cast<int>(std::floor(-point.down_m))};
}

Figures OpenVdb(const Scene& scene) {
  Figures figures;
  const auto grid = openvdb::FloatGrid::create(0.0f);
  figures.update_s = SecondsOf([&] {
    auto accessor = grid->getAccessor();
    for (const NedPoint& point : scene.points) {
      accessor.modifyValueAndActiveState(ToVdb(point),
                                         [](float& log_odds, bool& active) {
                                           log_odds += kHit;
                                           active = true;
                                         });
    }
  });
  figures.query_s = SecondsOf([&] {
    const auto accessor = grid->getConstAccessor();
    for (const auto& [place, point] : scene.queries) {
      figures.found += accessor.getValue(ToVdb(point)) > 0;
    }
  });
  figures.bytes = static_cast<double>(grid->memUsage());
  return figures;
}
#endif

nlohmann::json Report(const Scene& scene, const Figures& figures) {
  return {
      {"updates_per_s",
       static_cast<double>(scene.points.size()) / figures.update_s},
      {"query_ns", figures.query_s / static_cast<double>(kQueries) * 1e9},
      {"bytes_per_km2", figures.bytes / scene.square_km},
      {"found", figures.found / static_cast<double>(kQueries)},
  };
}

int Main() {
#ifdef FATHOM_HAVE_OPENVDB
  openvdb::initialize();
#endif
  const Scene scene = MakeScene();
  Figures ours;
  [[maybe_unused]] Figures octomap;
  [[maybe_unused]] Figures openvdb;
  for (int round = 0; round < kRounds; ++round) {
    Keep(ours, Ours(scene));
#ifdef FATHOM_HAVE_OCTOMAP
    Keep(octomap, OctoMap(scene));
#endif
#ifdef FATHOM_HAVE_OPENVDB
    Keep(openvdb, OpenVdb(scene));
#endif
  }
  nlohmann::json report;
  report["fathom"] = Report(scene, ours);
#ifdef FATHOM_HAVE_OCTOMAP
  report["octomap"] = Report(scene, octomap);
#endif
#ifdef FATHOM_HAVE_OPENVDB
  report["openvdb"] = Report(scene, openvdb);
#endif
  std::cout << report.dump(2) << "\n";
  return 0;
}

}  // namespace
}  // namespace fathom::map

int main() { return fathom::map::Main(); }
