// A live server with something of everything, and what the oracle (oracle.h)
// needs to know of it: a chart with land, unknown water, open activities of
// each estimator with and without a prior, completed ones whose answers come
// from the global map, tracks of four classes.

#ifndef FATHOM_TESTS_INTEGRATION_ORACLE_SCENE_H_
#define FATHOM_TESTS_INTEGRATION_ORACLE_SCENE_H_

#include <GeographicLib/LocalCartesian.hpp>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "base/time.h"
#include "client/client.h"
#include "tests/integration/live_server.h"
#include "tests/integration/oracle.h"

namespace fathom::client {

// Metres north and east of a place, that of the scene's corner by default, on
// one tangent plane.
class Plane {
 public:
  explicit Plane(double latitude_deg = 41.5, double longitude_deg = -71.4)
      : frame_(latitude_deg, longitude_deg, 0) {}
  v1::GeodeticPoint ToGeodetic(double north_m, double east_m) const;
  // What is north at a place, seen on the plane, radians clockwise.
  double NorthAt(const v1::GeodeticPoint& p) const;

 private:
  GeographicLib::LocalCartesian frame_;
};

// An activity and what was sounded in it.
struct Area {
  const char* name;
  double north_m;
  double east_m;
  int cells;
  oracle::Rule rule;
  // Below what was sounded.
  std::optional<oracle::Depth> prior;
  // Its evidence lies in the global map.
  bool completed = false;
  // By row and column: what kKalman or kNervegna made of it, or the soundings.
  std::map<std::pair<int, int>, oracle::Depth> fused = {};
  std::map<std::pair<int, int>, std::vector<oracle::Sounding>> soundings = {};

  double side_m() const;
  // What is known of a cell.
  oracle::Seabed Cell(int row, int column) const;
};

// What is under a place.
struct Ground {
  oracle::Seabed seabed;
  // Read from the global map after a transfer: stds are rounded to its codes.
  bool stored = false;
};

class OracleScene : public ClientLive {
 protected:
  static constexpr unsigned kSeed = 20'260'101;
  static constexpr double kCellM = 10;
  static constexpr double kAgeingM2PerDay = 5;
  // The server keeps depths and stds as floats: 2e-6 m of 30 m, divided by the
  // least std of 0.1 m, times the density's peak 0.4: 8e-6. Its normal law is
  // good to 1e-15, its disc to 1e-6 (map/query). That each contact has a
  // tangent plane of its own, the oracle one for all, shifts places by 1e-4 m
  // of 7 m and more: 6e-6. (Met: 6e-6;
  // 1.3e-5 of the adaptive estimator, which reckons in floats.)
  static constexpr double kTolerance = 2e-5;
  // The global map's codes round a std to 0.9 % and to another 0.1 %
  // (map/global/leaf.h), and d Phi(a / s) / (d s / s) is 0.242 at most.
  static constexpr double kStoredStdShare = 0.0105;
  static constexpr double kStoredTolerance = 0.242 * kStoredStdShare;

  void SetUp() override;

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double Normal(double std) {
    return std::normal_distribution<double>(0, std)(random_);
  }
  int Pick(int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(random_);
  }
  Time At(double time_s) const {
    return base_ + std::chrono::microseconds(std::llround(1e6 * time_s));
  }

  // What is under a place; absent too near to a border to be sure which side
  // of it the server's cells put it.
  std::optional<Ground> GroundAt(double north_m, double east_m) const;

  std::mt19937_64 random_{kSeed};
  Plane plane_;
  std::unique_ptr<LiveServer> server_;
  std::unique_ptr<Client> client_;
  Time base_;
  std::vector<Area> areas_;
  std::vector<oracle::Track> tracks_;

 private:
  void ImportChart();
  void Survey(Area& area);
  // A sounding of a cell: anything for the estimators that take each by
  // itself; for the adaptive one of a floor that slopes, with a few rocks.
  oracle::Sounding Sound(const Area& area, int row, int column, double time_s);
  void ReportTracks();
};

}  // namespace fathom::client

#endif  // FATHOM_TESTS_INTEGRATION_ORACLE_SCENE_H_
