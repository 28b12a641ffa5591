#include "map/obstacle_map/find_nearest.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/local/local_block.h"
#include "map/obstacle_map/near_plane.h"

namespace fathom::map {
namespace {

// Parts of the global map wider than this are opened unless their middle is
// far: the plane at the place asked does not reach their corners.
constexpr double kPlaneReachM = 300'000;

// How far the nearest point of a piece with sides of `side_m` may be off on the
// plane, whose great circles are those of a sphere.
double SlackM(double side_m) { return 2e-9 * side_m * side_m + 0.01; }

// A part of the map that may hold what is sought, no nearer than bound_m.
struct Part {
  double bound_m = 0;
  // Of an activity: blocks [row, row + rows) x [col, col + cols). Null: a cell
  // of the global map.
  const ActivityView* activity = nullptr;
  std::uint32_t row = 0;
  std::uint32_t col = 0;
  std::uint32_t rows = 0;
  std::uint32_t cols = 0;
  std::uint8_t level = 0;

  CellKey cell() const { return {.level = level, .row = row, .col = col}; }
  // Nearest first; equal ones in a fixed order.
  friend bool operator>(const Part& a, const Part& b) {
    if (a.bound_m != b.bound_m) return a.bound_m > b.bound_m;
    if (a.level != b.level) return a.level > b.level;
    return a.row != b.row ? a.row > b.row : a.col > b.col;
  }
};

class Search {
 public:
  Search(const ObstacleMapView& view, const NearestQuestion& question,
         const NearestSearch& options)
      : view_(view),
        question_(question),
        options_(options),
        plane_(question.query.position),
        solid_above_m_(question.query.depth_m +
                       question.query.vertical_clearance_m),
        best_m_(std::nextafter(question.search_radius_m,
                               std::numeric_limits<double>::infinity())) {
    query_ = question.query;
    query_.radius_m = 0;
  }

  absl::StatusOr<std::optional<NearestObstacle>> Run() {
    if (JudgeSeabed(query_.position)) {
      best_m_ = 0;
      Take(query_.position, query_.position);
    } else {
      LookAtContacts();
      LookAtBorder();
      PushActivities();
      if (view_.global().root_tile() != nullptr) PushCell(CellKey{});
      FATHOM_RETURN_IF_ERROR(OpenAll());
    }
    if (!found_) return std::nullopt;
    return Tell();
  }

 private:
  // Whether what the seabed is at `point` counts.
  bool JudgeSeabed(const GeodeticPoint& point) const {
    return Counts(view_.SeabedAt(point));
  }
  bool Counts(const std::optional<SeabedEstimate>& seabed) const {
    const ObstacleAnswer answer =
        Answer(query_, seabed, no_contacts_,
               {.ageing_rate_m2_s = view_.ageing_rate_m2_s()});
    switch (answer.state) {
      case ObstacleState::kOccupied:
        return true;
      case ObstacleState::kUnknown:
        return !question_.unknown_is_free;
      default:
        return ReachesHazard(answer.seabed->estimate, solid_above_m_);
    }
  }

  void Take(const GeodeticPoint& nearest, const GeodeticPoint& judged) {
    found_ = true;
    nearest_ = nearest;
    judged_ = judged;
    contact_.reset();
  }
  // A piece that counts, judged at `middle`.
  void TakePiece(const std::array<GeodeticPoint, 4>& corners,
                 const GeodeticPoint& middle) {
    const NearPlane::Nearest nearest = plane_.Of(corners);
    if (nearest.distance_m == 0) {
      best_m_ = 0;
      Take(query_.position, middle);
      return;
    }
    if (nearest.distance_m - 1 > best_m_) return;
    const GeodeticPoint point = plane_.ToGeodetic(nearest);
    const double distance_m = DistanceM(query_.position, point);
    if (distance_m >= best_m_) return;
    best_m_ = distance_m;
    Take(point, middle);
  }

  bool DepthsMeet(const ContactPoint& contact) const {
    const double slack_m = kDepthSigmas * contact.depth_std_m;
    const double shallow_m = query_.depth_m - query_.vertical_clearance_m;
    if (shallow_m > contact.keel_depth_m + slack_m) return false;
    // A surface contact is solid from the surface up as well.
    return !(contact.top_depth_m > 0 &&
             solid_above_m_ < contact.top_depth_m - slack_m);
  }

  void LookAtContacts() {
    view_.contacts().ForEachNear(
        query_.position, question_.search_radius_m, query_.time,
        [&](const NearContact& near) {
          if (!DepthsMeet(near.predicted)) return;
          const GeodeticPoint place = near.predicted.Position();
          const RangeAzimuth way = Inverse(query_.position, place);
          const double distance_m =
              std::max(0.0, way.distance_m - near.predicted.radius_m);
          if (distance_m >= best_m_) return;
          best_m_ = distance_m;
          Take(Direct(query_.position, way.azimuth_deg, distance_m), place);
          contact_ = near.contact->key();
        });
  }

  // Beyond the square's sides nothing is known.
  void LookAtBorder() {
    const RootSquare& root = view_.global().root();
    if (question_.unknown_is_free || view_.global().root_tile() == nullptr) {
      return;
    }
    for (const bool of_u : {true, false}) {
      for (const double side : {0.0, 1.0}) {
        const auto at = [&](double along, double beyond) {
          const double across = side + (side == 0 ? -beyond : beyond);
          return root.Unproject(of_u ? SquarePoint{.u = across, .v = along}
                                     : SquarePoint{.u = along, .v = across});
        };
        // The distance to a great circle has one least value within a quarter
        // of the Earth: thirds of [0, 1] down to 1e-12 of a side.
        double low = 0;
        double high = 1;
        for (int step = 0; step < 70; ++step) {
          const double third = (high - low) / 3;
          if (DistanceM(query_.position, at(low + third, 0)) <
              DistanceM(query_.position, at(high - third, 0))) {
            high -= third;
          } else {
            low += third;
          }
        }
        const double along = 0.5 * (low + high);
        const GeodeticPoint border = at(along, 0);
        const double distance_m = DistanceM(query_.position, border);
        if (distance_m >= best_m_) continue;
        const GeodeticPoint beyond = at(along, 1e-9);
        if (!JudgeSeabed(beyond)) continue;
        best_m_ = distance_m;
        Take(border, beyond);
      }
    }
  }

  void PushActivities() {
    for (const ActivityView* activity : view_.open_newest_first()) {
      const LocalMapView& local = *activity->local;
      PushBlocks({.activity = activity,
                  .rows = (local.cells_north() + kBlockSide - 1) / kBlockSide,
                  .cols = (local.cells_east() + kBlockSide - 1) / kBlockSide});
    }
  }

  std::array<GeodeticPoint, 4> Corners(const LocalMapView& local,
                                       std::uint32_t row_first,
                                       std::uint32_t row_end,
                                       std::uint32_t col_first,
                                       std::uint32_t col_end) const {
    const double cell_m = local.options().cell_size_m;
    const double south_m = row_first * cell_m;
    const double north_m = std::min(row_end, local.cells_north()) * cell_m;
    const double west_m = col_first * cell_m;
    const double east_m = std::min(col_end, local.cells_east()) * cell_m;
    const NedFrame& frame = local.frame();
    return {
        frame.ToGeodetic(south_m, west_m), frame.ToGeodetic(north_m, west_m),
        frame.ToGeodetic(north_m, east_m), frame.ToGeodetic(south_m, east_m)};
  }
  std::array<GeodeticPoint, 4> Corners(const Part& part) const {
    return Corners(*part.activity->local, part.row * kBlockSide,
                   (part.row + part.rows) * kBlockSide, part.col * kBlockSide,
                   (part.col + part.cols) * kBlockSide);
  }

  void PushBlocks(Part part) {
    const std::array<GeodeticPoint, 4> corners = Corners(part);
    // The other side of the Earth folds onto the plane.
    if (DistanceM(query_.position, corners[0]) > kPlaneReachM) return;
    const double side_m = std::max(part.rows, part.cols) * double{kBlockSide} *
                          part.activity->local->options().cell_size_m;
    part.bound_m = plane_.Of(corners).distance_m - SlackM(side_m);
    if (part.bound_m < best_m_) parts_.push(part);
  }

  void PushCell(const CellKey& cell) {
    const RootSquare& root = view_.global().root();
    const double side_m = root.cell_size_m(cell.level);
    Part part{.row = cell.row, .col = cell.col, .level = cell.level};
    if (side_m > kPlaneReachM) {
      // A cell's middle is within 0.9 of its longer side of all of it.
      part.bound_m =
          DistanceM(query_.position, root.Center(cell)) - 0.9 * side_m;
    } else {
      part.bound_m = plane_.Of(root.Corners(cell)).distance_m - SlackM(side_m);
    }
    if (part.bound_m < best_m_) parts_.push(part);
  }

  absl::Status Spend(std::uint64_t cells) {
    if (options_.stop != nullptr &&
        options_.stop->load(std::memory_order_relaxed)) {
      return absl::CancelledError("nobody waits for the nearest obstacle");
    }
    spent_ += cells;
    if (spent_ <= options_.most_cells) return absl::OkStatus();
    return absl::ResourceExhaustedError(absl::StrFormat(
        "search_radius_m=%g: more than %u cells lie nearer than the nearest "
        "obstacle; ask for a smaller radius",
        question_.search_radius_m, options_.most_cells));
  }

  absl::Status OpenAll() {
    while (!parts_.empty() && parts_.top().bound_m < best_m_) {
      const Part part = parts_.top();
      parts_.pop();
      FATHOM_RETURN_IF_ERROR(Spend(1));
      if (part.activity == nullptr) {
        OpenCell(part.cell());
      } else if (part.rows > 1 || part.cols > 1) {
        Halve(part);
      } else if (MayCount(part)) {
        FATHOM_RETURN_IF_ERROR(OpenBlock(part));
      }
    }
    return absl::OkStatus();
  }

  void Halve(const Part& part) {
    Part first = part;
    Part second = part;
    if (part.rows >= part.cols) {
      first.rows = part.rows / 2;
      second.row += first.rows;
      second.rows -= first.rows;
    } else {
      first.cols = part.cols / 2;
      second.col += first.cols;
      second.cols -= first.cols;
    }
    PushBlocks(first);
    PushBlocks(second);
  }

  // False: no cell of the block counts, for no activity has anything to say
  // there and the global map is deeper.
  bool MayCount(const Part& part) const {
    if (!question_.unknown_is_free) return true;
    for (const ActivityView* activity : view_.open_newest_first()) {
      if (activity != part.activity ||
          activity->local->DefaultPrior().has_value()) {
        return true;
      }
    }
    const std::int64_t reach =
        1 + (kMaxSmoothReach + std::int64_t{kBlockSide} - 1) / kBlockSide;
    for (std::int64_t row = part.row - reach; row <= part.row + reach; ++row) {
      for (std::int64_t col = part.col - reach; col <= part.col + reach;
           ++col) {
        if (row < 0 || col < 0) continue;
        if (part.activity->local->Block(
                {.row = static_cast<std::uint32_t>(row),
                 .col = static_cast<std::uint32_t>(col)}) != nullptr) {
          return true;
        }
      }
    }
    const GlobalMapView& global = view_.global();
    const auto box = global.root().BoxAround(Corners(part));
    if (!box.has_value() || global.root_tile() == nullptr) return true;
    // At most 3 x 3 cells of the block's size, one more about them for what
    // the box leaves out.
    const int level = global.root().LevelFor(
        kBlockSide * part.activity->local->options().cell_size_m);
    const int up = kMaxLevel - level;
    const std::int64_t last = (std::int64_t{1} << level) - 1;
    const auto from = [&](std::uint32_t first) {
      return std::max<std::int64_t>(0, (first >> up) - std::int64_t{1});
    };
    const auto to = [&](std::uint32_t end) {
      return std::min<std::int64_t>(last, (end >> up) + std::int64_t{1});
    };
    for (std::int64_t row = from(box->row_first); row <= to(box->row_last);
         ++row) {
      for (std::int64_t col = from(box->col_first); col <= to(box->col_last);
           ++col) {
        const auto bounds =
            global.Bounds({.level = static_cast<std::uint8_t>(level),
                           .row = static_cast<std::uint32_t>(row),
                           .col = static_cast<std::uint32_t>(col)});
        if (bounds.has_value() &&
            double{bounds->shoalest_m} <= solid_above_m_) {
          return true;
        }
      }
    }
    return false;
  }

  absl::Status OpenBlock(const Part& part) {
    const LocalMapView& local = *part.activity->local;
    const std::uint32_t row_end =
        std::min((part.row + 1) * kBlockSide, local.cells_north());
    const std::uint32_t col_end =
        std::min((part.col + 1) * kBlockSide, local.cells_east());
    for (std::uint32_t i = part.row * kBlockSide; i < row_end; ++i) {
      FATHOM_RETURN_IF_ERROR(Spend(kBlockSide));
      for (std::uint32_t j = part.col * kBlockSide; j < col_end; ++j) {
        const GeodeticPoint middle =
            local.CellCenter({.i = static_cast<std::int32_t>(i),
                              .j = static_cast<std::int32_t>(j)});
        if (JudgeSeabed(middle)) {
          TakePiece(Corners(local, i, i + 1, j, j + 1), middle);
        }
      }
    }
    return absl::OkStatus();
  }

  // Whether the cell may share a place with an open activity.
  bool TouchesActivity(const CellKey& cell) const {
    const RootSquare& root = view_.global().root();
    // Too wide for an activity's plane, or for that at the place asked.
    if (root.cell_size_m(cell.level) > kPlaneReachM) return true;
    const std::array<GeodeticPoint, 4> corners = root.Corners(cell);
    const double slack_m = 1 + SlackM(root.cell_size_m(cell.level));
    for (const ActivityView* activity : view_.open_newest_first()) {
      const LocalMapView& local = *activity->local;
      if (DistanceM(local.frame().origin(), corners[0]) > 4 * kPlaneReachM) {
        continue;
      }
      double south_m = std::numeric_limits<double>::infinity();
      double west_m = south_m;
      double north_m = -south_m;
      double east_m = -south_m;
      for (const GeodeticPoint& corner : corners) {
        const NedPoint at = local.frame().ToNed(corner);
        south_m = std::min(south_m, at.north_m);
        north_m = std::max(north_m, at.north_m);
        west_m = std::min(west_m, at.east_m);
        east_m = std::max(east_m, at.east_m);
      }
      const double cell_m = local.options().cell_size_m;
      if (north_m + slack_m >= 0 && east_m + slack_m >= 0 &&
          south_m - slack_m <= local.cells_north() * cell_m &&
          west_m - slack_m <= local.cells_east() * cell_m) {
        return true;
      }
    }
    return false;
  }

  void OpenCell(const CellKey& cell) {
    const GlobalMapView& global = view_.global();
    const RootSquare& root = global.root();
    const TileSlot* slot = global.root_slot();
    while (true) {
      const TileTotals& totals = slot->totals();
      const int below = cell.level - slot->key().level;
      if (below == 0) {
        const bool known = totals.known_leaves == totals.leaves;
        if ((question_.unknown_is_free || known) &&
            double{totals.shoalest_m} > solid_above_m_) {
          return;
        }
        if (totals.leaves > 1) break;
      }
      const Tile::Found found =
          slot->tile().Find(PositionInTile(cell, slot->key().level));
      if (found.child != nullptr && below >= found.level) {
        slot = found.child;
        continue;
      }
      if (found.level > below) break;
      OpenLeaf(cell, found.leaf);
      return;
    }
    if (question_.unknown_is_free) {
      const auto bounds = global.Bounds(cell);
      if (!bounds.has_value() || double{bounds->shoalest_m} > solid_above_m_) {
        return;
      }
    }
    if (cell.level < root.max_level()) Divide(cell);
  }

  // The cell lies in one leaf.
  void OpenLeaf(const CellKey& cell, const Leaf& leaf) {
    if (leaf.known() ? double{leaf.depth_m} > solid_above_m_
                     : question_.unknown_is_free) {
      return;
    }
    const RootSquare& root = view_.global().root();
    const GeodeticPoint middle = root.Center(cell);
    std::optional<SeabedEstimate> seabed =
        view_.SeabedAt(middle, LayerChoice::kGlobalOnly);
    if (!Counts(seabed)) return;
    if (TouchesActivity(cell)) {
      if (cell.level < root.max_level()) {
        Divide(cell);
        return;
      }
      seabed = view_.SeabedAt(middle);
      if ((seabed.has_value() && seabed->local) || !Counts(seabed)) return;
    }
    TakePiece(root.Corners(cell), middle);
  }

  void Divide(const CellKey& cell) {
    const auto level = static_cast<std::uint8_t>(cell.level + 1);
    for (std::uint32_t k = 0; k < 4; ++k) {
      PushCell({.level = level,
                .row = 2 * cell.row + k / 2,
                .col = 2 * cell.col + k % 2});
    }
  }

  NearestObstacle Tell() const {
    NearestObstacle nearest;
    nearest.position = nearest_;
    const RangeAzimuth way = Inverse(query_.position, nearest_);
    nearest.distance_m = best_m_ == 0 ? 0 : way.distance_m;
    if (nearest.distance_m > 0) {
      nearest.bearing_deg =
          way.azimuth_deg < 0 ? way.azimuth_deg + 360 : way.azimuth_deg;
      if (nearest.bearing_deg >= 360) nearest.bearing_deg = 0;
    }
    ObstacleQuery there = query_;
    there.position = judged_;
    nearest.answer = view_.Answer(there);
    nearest.contact = contact_;
    return nearest;
  }

  const ObstacleMapView& view_;
  const NearestQuestion& question_;
  const NearestSearch& options_;
  const NearPlane plane_;
  const double solid_above_m_;
  const ContactsView no_contacts_;
  ObstacleQuery query_;
  // What counts is nearer than this; that of the best found.
  double best_m_;
  bool found_ = false;
  GeodeticPoint nearest_;
  GeodeticPoint judged_;
  std::optional<ContactKey> contact_;
  std::uint64_t spent_ = 0;
  std::priority_queue<Part, std::vector<Part>, std::greater<>> parts_;
};

}  // namespace

absl::StatusOr<std::optional<NearestObstacle>> FindNearestObstacle(
    const ObstacleMapView& view, const NearestQuestion& question,
    const NearestSearch& search) {
  FATHOM_RETURN_IF_ERROR(ValidateQuery(question.query));
  if (!(question.search_radius_m > 0 &&
        question.search_radius_m <= kMaxSearchRadiusM)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("search_radius_m=%g must be in (0, %g]",
                        question.search_radius_m, kMaxSearchRadiusM));
  }
  return Search(view, question, search).Run();
}

}  // namespace fathom::map
