// A path planner: the shortest way through water that the map is sure of.
//
//   planner 127.0.0.1:7430 41.5022,-71.3994 41.5022,-71.3946 10
//   planner 127.0.0.1:7430 41.5022,-71.3994 41.5022,-71.3946 10 --go
//
// 1. GetRegion fetches the area around start and goal as one grid.
// 2. A* finds the shortest way over its passable cells.
// 3. CheckTrajectory judges the way as the map knows it, cell by cell of the
//    finest layer and with every contact where it will be at the time. The
//    legs that it objects to are closed in the grid, and step 2 runs again.
// 4. With --go a vehicle sets out (here: a clock). WatchTrajectory tells when
//    what is sounded or sighted meanwhile makes the way unsafe: the vehicle
//    stops, and step 1 runs again from where it is.
//
// Prints one line for each waypoint. Exit code: 0 a free way was found (with
// --go: and the goal was reached), 3 there is none, 1 anything else. The area
// must not cross the antimeridian.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <future>
#include <optional>
#include <queue>
#include <utility>
#include <vector>

#include "base/status_macros.h"
#include "client/client.h"
#include "client/proto_time.h"

namespace v1 = fathom::v1;
using fathom::client::Client;
using fathom::client::Region;

namespace {

// The vehicle and how careful it is.
constexpr double kConfidence = 0.95;
constexpr double kConfidenceSigmas = 1.645;  // Phi^-1(0.95).
constexpr double kClearanceM = 2;
constexpr double kRadiusM = 5;
constexpr double kSpeedMS = 2;
constexpr double kResolutionM = 10;
// The area reaches so far around start and goal.
constexpr double kMarginM = 500;
constexpr double kMetresPerDegree = 111'200;  // Of latitude, to 1 %.
// Longest leg: each is judged as one, so it tells where the trouble is.
constexpr double kLegM = 50;
// Ways that CheckTrajectory may refuse before we give up.
constexpr int kMaxPlans = 50;

// A cell of the grid.
struct Cell {
  int row = 0;
  int column = 0;
};

// The area as the planner sees it: passable cells and their neighbours.
class Chart {
 public:
  Chart(Region region, double depth_m)
      : region_(std::move(region)), open_(region_.depth_m.size()) {
    std::vector<bool> passable(open_.size());
    for (std::size_t i = 0; i < open_.size(); ++i) {
      // P(D <= z + h) <= 1 - c, and nothing in the cell stands higher. NaN,
      // where the depth is unknown, compares false: unknown is not passable.
      const double keep_m = depth_m + kClearanceM;
      passable[i] =
          region_.kind[i] != v1::EVIDENCE_KIND_LAND &&
          region_.depth_m[i] - kConfidenceSigmas * region_.std_m[i] >= keep_m &&
          region_.shoalest_m[i] > keep_m;
    }
    // The vehicle is wider than a point.
    const int wide = static_cast<int>(std::ceil(kRadiusM / kResolutionM));
    for (int row = 0; row < Rows(); ++row) {
      for (int column = 0; column < Columns(); ++column) {
        bool all = true;
        for (int i = row - wide; all && i <= row + wide; ++i) {
          for (int j = column - wide; all && j <= column + wide; ++j) {
            all = Inside({i, j}) && passable[Index({i, j})];
          }
        }
        open_[Index({row, column})] = all;
      }
    }
  }

  int Rows() const { return static_cast<int>(region_.rows); }
  int Columns() const { return static_cast<int>(region_.columns); }
  std::size_t Size() const { return open_.size(); }
  bool Inside(Cell c) const {
    return c.row >= 0 && c.row < Rows() && c.column >= 0 &&
           c.column < Columns();
  }
  bool IsOpen(Cell c) const { return Inside(c) && open_[Index(c)]; }
  // Closes the cells within half a leg and the vehicle's radius.
  void Close(Cell c) {
    constexpr int kReach =
        static_cast<int>((kLegM / 2 + kRadiusM) / kResolutionM);
    for (int i = c.row - kReach; i <= c.row + kReach; ++i) {
      for (int j = c.column - kReach; j <= c.column + kReach; ++j) {
        if (Inside({i, j})) open_[Index({i, j})] = false;
      }
    }
  }

  Cell CellOf(const v1::GeodeticPoint& p) const {
    return {static_cast<int>(std::floor(
                (region_.north_west.latitude_deg() - p.latitude_deg()) /
                region_.latitude_step_deg)),
            static_cast<int>(std::floor(
                (p.longitude_deg() - region_.north_west.longitude_deg()) /
                region_.longitude_step_deg))};
  }
  v1::GeodeticPoint PointOf(Cell c) const {
    v1::GeodeticPoint point;
    point.set_latitude_deg(region_.north_west.latitude_deg() -
                           (c.row + 0.5) * region_.latitude_step_deg);
    point.set_longitude_deg(region_.north_west.longitude_deg() +
                            (c.column + 0.5) * region_.longitude_step_deg);
    return point;
  }

  std::size_t Index(Cell c) const {
    return region_.Index(static_cast<std::uint32_t>(c.row),
                         static_cast<std::uint32_t>(c.column));
  }

 private:
  Region region_;
  std::vector<bool> open_;
};

double Distance(Cell a, Cell b) {
  return std::hypot(a.row - b.row, a.column - b.column);
}

// A*: the shortest way over open cells and their eight neighbours, not cutting
// corners; empty if there is none.
std::vector<Cell> ShortestWay(const Chart& chart, Cell start, Cell goal) {
  struct Node {
    double estimate;
    Cell cell;
    bool operator>(const Node& other) const {
      return estimate > other.estimate;
    }
  };
  if (!chart.IsOpen(start) || !chart.IsOpen(goal)) return {};
  const std::size_t size = chart.Size();
  std::vector<double> cost(size, INFINITY);
  std::vector<Cell> before(size);
  std::priority_queue<Node, std::vector<Node>, std::greater<>> open;
  cost[chart.Index(start)] = 0;
  open.push({Distance(start, goal), start});
  while (!open.empty()) {
    const Cell here = open.top().cell;
    const double estimate = open.top().estimate;
    open.pop();
    const double travelled = cost[chart.Index(here)];
    if (estimate > travelled + Distance(here, goal) + 1e-9) continue;
    if (here.row == goal.row && here.column == goal.column) break;
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        const Cell next{here.row + i, here.column + j};
        if (!chart.IsOpen(next) || !chart.IsOpen({here.row, next.column}) ||
            !chart.IsOpen({next.row, here.column})) {
          continue;
        }
        const double there = travelled + Distance(here, next);
        if (there >= cost[chart.Index(next)]) continue;
        cost[chart.Index(next)] = there;
        before[chart.Index(next)] = here;
        open.push({there + Distance(next, goal), next});
      }
    }
  }
  if (!std::isfinite(cost[chart.Index(goal)])) return {};
  std::vector<Cell> way = {goal};
  while (way.back().row != start.row || way.back().column != start.column) {
    way.push_back(before[chart.Index(way.back())]);
  }
  std::reverse(way.begin(), way.end());
  return way;
}

// Whether the straight line between two cells' centres stays in open cells.
bool IsClear(const Chart& chart, Cell a, Cell b) {
  const int steps = static_cast<int>(std::ceil(4 * Distance(a, b)));
  for (int i = 0; i <= steps; ++i) {
    const double t = steps > 0 ? static_cast<double>(i) / steps : 0;
    if (!chart.IsOpen(
            {static_cast<int>(std::lround(a.row + t * (b.row - a.row))),
             static_cast<int>(
                 std::lround(a.column + t * (b.column - a.column)))})) {
      return false;
    }
  }
  return true;
}

// A way as straight legs of at most kLegM.
std::vector<Cell> Legs(const Chart& chart, const std::vector<Cell>& way) {
  constexpr double kLegCells = kLegM / kResolutionM;
  std::vector<Cell> ends = {way.front()};
  for (std::size_t i = 1; i + 1 < way.size(); ++i) {
    if (Distance(ends.back(), way[i + 1]) > kLegCells ||
        !IsClear(chart, ends.back(), way[i + 1])) {
      ends.push_back(way[i]);
    }
  }
  ends.push_back(way.back());
  return ends;
}

// The legs' ends with the time at which the vehicle is there.
v1::Trajectory Timed(const Chart& chart, const std::vector<Cell>& ends,
                     double depth_m, fathom::Time start) {
  v1::Trajectory trajectory;
  double travelled_m = 0;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    if (i > 0) travelled_m += kResolutionM * Distance(ends[i - 1], ends[i]);
    v1::Waypoint* waypoint = trajectory.add_waypoints();
    *waypoint->mutable_position() = chart.PointOf(ends[i]);
    waypoint->set_depth_m(depth_m);
    *waypoint->mutable_time() = fathom::client::ToProto(
        start +
        std::chrono::microseconds(std::llround(1e6 * travelled_m / kSpeedMS)));
  }
  trajectory.set_radius_m(kRadiusM);
  trajectory.set_vertical_clearance_m(kClearanceM);
  trajectory.set_confidence(kConfidence);
  trajectory.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_OCCUPIED);
  return trajectory;
}

// The area around start and goal, as the map knows it now.
absl::StatusOr<Chart> FetchChart(const Client& client,
                                 const v1::GeodeticPoint& start,
                                 const v1::GeodeticPoint& goal,
                                 double depth_m) {
  const double south = std::min(start.latitude_deg(), goal.latitude_deg());
  const double north = std::max(start.latitude_deg(), goal.latitude_deg());
  const double west = std::min(start.longitude_deg(), goal.longitude_deg());
  const double east = std::max(start.longitude_deg(), goal.longitude_deg());
  const double up = kMarginM / kMetresPerDegree;
  const double across = up / std::cos(start.latitude_deg() * M_PI / 180);
  v1::GetRegionRequest request;
  request.mutable_south_west()->set_latitude_deg(south - up);
  request.mutable_south_west()->set_longitude_deg(west - across);
  request.mutable_north_east()->set_latitude_deg(north + up);
  request.mutable_north_east()->set_longitude_deg(east + across);
  request.set_resolution_m(kResolutionM);
  FATHOM_ASSIGN_OR_RETURN(Region region, client.GetRegion(request));
  std::printf("chart: %u x %u cells of %g m, revision %llu\n", region.rows,
              region.columns, kResolutionM,
              static_cast<unsigned long long>(region.stamp.map_revision()));
  return Chart(std::move(region), depth_m);
}

fathom::Time Now() {
  return std::chrono::time_point_cast<fathom::Duration>(
      std::chrono::system_clock::now());
}

// A way that CheckTrajectory calls FREE; absent if there is none.
absl::StatusOr<std::optional<v1::Trajectory>> Plan(const Client& client,
                                                   Chart& chart, Cell start,
                                                   Cell goal, double depth_m) {
  for (int i = 0; i < kMaxPlans; ++i) {
    const std::vector<Cell> way = ShortestWay(chart, start, goal);
    if (way.empty()) return std::nullopt;
    const std::vector<Cell> ends = Legs(chart, way);
    v1::CheckTrajectoryRequest request;
    *request.mutable_trajectory() = Timed(chart, ends, depth_m, Now());
    FATHOM_ASSIGN_OR_RETURN(const v1::CheckTrajectoryResponse verdict,
                            client.CheckTrajectory(request));
    if (verdict.state() == v1::OBSTACLE_STATE_FREE) {
      return request.trajectory();
    }
    int refused = 0;
    for (std::size_t leg = 0; leg + 1 < ends.size(); ++leg) {
      if (verdict.legs(static_cast<int>(leg)).state() ==
          v1::OBSTACLE_STATE_FREE) {
        continue;
      }
      chart.Close({(ends[leg].row + ends[leg + 1].row) / 2,
                   (ends[leg].column + ends[leg + 1].column) / 2});
      ++refused;
    }
    std::printf("refused: %d of %d legs\n", refused, verdict.legs_size());
  }
  return std::nullopt;
}

void Print(const v1::Trajectory& plan) {
  std::printf("free at %g %% confidence:\n", 100 * kConfidence);
  const auto begin = plan.waypoints(0).time().seconds();
  for (const v1::Waypoint& waypoint : plan.waypoints()) {
    std::printf("  %.6f,%.6f after %lld s\n",
                waypoint.position().latitude_deg(),
                waypoint.position().longitude_deg(),
                static_cast<long long>(waypoint.time().seconds() - begin));
  }
  std::fflush(stdout);
}

// Where a vehicle is that follows the plan.
v1::GeodeticPoint PositionAt(const v1::Trajectory& plan, fathom::Time time) {
  const auto& waypoints = plan.waypoints();
  int next = 1;
  while (next + 1 < waypoints.size() &&
         fathom::client::FromProto(waypoints[next].time()) < time) {
    ++next;
  }
  const v1::Waypoint& a = waypoints[next - 1];
  const v1::Waypoint& b = waypoints[next];
  const fathom::Time left = fathom::client::FromProto(a.time());
  const std::chrono::duration<double> leg =
      fathom::client::FromProto(b.time()) - left;
  const double share =
      std::clamp(std::chrono::duration<double>(time - left) / leg, 0.0, 1.0);
  v1::GeodeticPoint place;
  place.set_latitude_deg(std::lerp(a.position().latitude_deg(),
                                   b.position().latitude_deg(), share));
  place.set_longitude_deg(std::lerp(a.position().longitude_deg(),
                                    b.position().longitude_deg(), share));
  return place;
}

// Follows the plan while it is safe; where that ended, absent: at the goal.
absl::StatusOr<std::optional<v1::GeodeticPoint>> Follow(
    const Client& client, const v1::Trajectory& plan) {
  v1::WatchTrajectoryRequest request;
  *request.mutable_trajectory() = plan;
  const auto watch = client.WatchTrajectory(request);
  std::future<absl::Status> alert =
      std::async(std::launch::async, [&watch]() -> absl::Status {
        while (true) {
          FATHOM_ASSIGN_OR_RETURN(const v1::WatchTrajectoryResponse event,
                                  watch->Next());
          if (event.alert()) return absl::OkStatus();
        }
      });
  const fathom::Time arrival = fathom::client::FromProto(
      plan.waypoints(plan.waypoints_size() - 1).time());
  if (alert.wait_until(arrival) == std::future_status::timeout) {
    watch->Cancel();
    return std::nullopt;
  }
  FATHOM_RETURN_IF_ERROR(alert.get());
  return PositionAt(plan, Now());
}

absl::StatusOr<int> Run(const char* server, v1::GeodeticPoint start,
                        const v1::GeodeticPoint& goal, double depth_m,
                        bool go) {
  FATHOM_ASSIGN_OR_RETURN(const auto client, Client::Connect(server, {}));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(Chart chart,
                            FetchChart(*client, start, goal, depth_m));
    FATHOM_ASSIGN_OR_RETURN(
        const std::optional<v1::Trajectory> plan,
        Plan(*client, chart, chart.CellOf(start), chart.CellOf(goal), depth_m));
    if (!plan.has_value()) {
      std::printf("no way at %g m with %g m of clearance\n", depth_m,
                  kClearanceM);
      return 3;
    }
    Print(*plan);
    if (!go) return 0;
    FATHOM_ASSIGN_OR_RETURN(const std::optional<v1::GeodeticPoint> stopped,
                            Follow(*client, *plan));
    if (!stopped.has_value()) {
      std::printf("arrived\n");
      return 0;
    }
    start = *stopped;
    std::printf("alert: stopped at %.6f,%.6f\n", start.latitude_deg(),
                start.longitude_deg());
  }
}

std::optional<v1::GeodeticPoint> ParsePoint(const char* text) {
  double latitude_deg = 0;
  double longitude_deg = 0;
  if (std::sscanf(text, "%lf,%lf", &latitude_deg, &longitude_deg) != 2) {
    return std::nullopt;
  }
  v1::GeodeticPoint point;
  point.set_latitude_deg(latitude_deg);
  point.set_longitude_deg(longitude_deg);
  return point;
}

}  // namespace

int main(int argc, char** argv) {
  const bool go = argc == 6 && std::strcmp(argv[5], "--go") == 0;
  const bool complete = argc == 5 || go;
  const auto start = complete ? ParsePoint(argv[2]) : std::nullopt;
  const auto goal = complete ? ParsePoint(argv[3]) : std::nullopt;
  if (!start.has_value() || !goal.has_value()) {
    std::fprintf(stderr,
                 "usage: planner SERVER LAT,LON LAT,LON DEPTH_M [--go]\n");
    return 1;
  }
  const absl::StatusOr<int> code =
      Run(argv[1], *start, *goal, std::atof(argv[4]), go);
  if (!code.ok()) {
    std::fprintf(stderr, "%s\n", code.status().ToString().c_str());
    return 1;
  }
  return *code;
}
