#include "map/obstacle_map/check_trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/geodesy/ned_frame.h"
#include "map/obstacle_map/leg_contacts.h"
#include "map/obstacle_map/timed_leg.h"
#include "map/query/closest_approach.h"
#include "map/query/stadium.h"

namespace fathom::map {
namespace {

// Cells judged between two looks at TrajectoryCheck::stop: 0.1 ms.
constexpr std::uint64_t kCellsPerLook = 256;
constexpr double kEarthRadiusM = 6.4e6;

// The worse of two states.
int Badness(ObstacleState state) {
  switch (state) {
    case ObstacleState::kFree:
      return 0;
    case ObstacleState::kUncertain:
      return 1;
    case ObstacleState::kUnknown:
      return 2;
    case ObstacleState::kOccupied:
      return 3;
  }
  return 3;
}

PlanePoint ToPlane(const NedPoint& point) {
  return {.north_m = point.north_m, .east_m = point.east_m};
}

// Indices of a grid that a span touches; none if first > last.
struct IndexRange {
  std::int32_t first;
  std::int32_t last;
  // The span lies wholly within the grid.
  bool inside;
};

// A cell of the map on its way to be judged.
struct PlacedCell {
  GeodeticPoint middle;
  // Along the piece: of the middle, and to either side the farthest at which
  // the swept disc may touch the cell; metres.
  double along_m = 0;
  double half_m = 0;
};

class Checker {
 public:
  Checker(const ObstacleMapView& view, const Trajectory& trajectory,
          const TrajectoryCheck& check)
      : view_(view),
        trajectory_(trajectory),
        check_(check),
        open_(view.open_newest_first()),
        half_width_m_(SweptHalfWidthM(trajectory)),
        finest_leaf_m_(view.global().root().cell_size_m(
            view.global().root().max_level())) {
    query_.confidence = trajectory.confidence;
    query_.vertical_clearance_m = trajectory.vertical_clearance_m;
    query_.radius_m = trajectory.radius_m;
  }

  absl::StatusOr<TrajectoryVerdict> Run() {
    for (std::size_t i = 0; i + 1 < trajectory_.waypoints.size(); ++i) {
      FATHOM_RETURN_IF_ERROR(CheckLeg(static_cast<std::uint32_t>(i)));
      if (check_.stop_at_first && verdict_.first_conflict.has_value()) break;
    }
    for (const LegVerdict& leg : verdict_.legs) {
      if (Badness(leg.state) > Badness(verdict_.state)) {
        verdict_.state = leg.state;
      }
    }
    FindApproaches();
    return std::move(verdict_);
  }

 private:
  // The closest points of approach of what is near, on the legs checked.
  void FindApproaches() {
    if (met_.empty()) return;
    std::vector<TimedPlace> path;
    for (std::size_t i = 0; i <= verdict_.legs.size(); ++i) {
      const Waypoint& waypoint = trajectory_.waypoints[i];
      path.push_back({.position = waypoint.position, .time = waypoint.time});
    }
    for (const Contact* contact : met_) {
      const auto approach = ClosestApproach(
          *contact, view_.contacts().classes(), path,
          {.within_m = contact->newest().radius_m + trajectory_.radius_m,
           .own_std_m = trajectory_.position_std_m});
      if (!approach.has_value()) continue;
      verdict_.approaches.push_back({.key = contact->key(),
                                     .time = approach->time,
                                     .distance_m = approach->distance_m,
                                     .probability = approach->probability,
                                     .links = contact->links()});
    }
    std::sort(verdict_.approaches.begin(), verdict_.approaches.end(),
              [](const ContactApproach& a, const ContactApproach& b) {
                if (a.distance_m != b.distance_m) {
                  return a.distance_m < b.distance_m;
                }
                return a.key < b.key;
              });
  }

  absl::Status CheckLeg(std::uint32_t index) {
    leg_index_ = index;
    verdict_.legs.emplace_back();
    const TimedLeg leg(trajectory_.waypoints[index],
                       trajectory_.waypoints[index + 1]);
    leg_ = &leg;
    contacts_.emplace(view_.contacts(), leg, query_, trajectory_.position_std_m,
                      half_width_m_);
    for (std::size_t piece = 0; piece < leg.piece_count() && status_.ok();
         ++piece) {
      CheckPiece(leg.piece(piece));
    }
    if (status_.ok()) {
      contacts_->ForEachMeeting(
          met_, [this](const LegContacts::Meeting& meeting) {
            query_.time = meeting.time;
            query_.position = meeting.vehicle;
            query_.depth_m = meeting.depth_m;
            Weigh(view_.SeabedAt(meeting.vehicle), meeting.contact_place);
          });
    }
    leg_ = nullptr;
    return status_;
  }

  void CheckPiece(const LegPiece& piece) {
    piece_ = &piece;
    // Finer than any leaf and covering the whole piece: no leaf need be asked.
    double covering_cell_m = std::numeric_limits<double>::infinity();
    on_activity_ = false;
    for (const ActivityView* activity : open_) {
      if (!activity->local->frame().Covers(piece.from)) continue;
      if (CheckActivity(*activity, piece)) {
        covering_cell_m =
            std::min(covering_cell_m, activity->options.cell_size_m);
      }
      if (!status_.ok()) return;
    }
    if (covering_cell_m > finest_leaf_m_) CheckGlobal(piece, covering_cell_m);
  }

  // Judges the activity's cells on the piece; true if the piece lies within
  // the activity.
  bool CheckActivity(const ActivityView& activity, const LegPiece& piece) {
    const LocalMapView& local = *activity.local;
    const double cell_m = local.options().cell_size_m;
    const Stadium swept = {.from = ToPlane(local.frame().ToNed(piece.from)),
                           .to = ToPlane(local.frame().ToNed(piece.to)),
                           .half_width_m = half_width_m_};
    const double half_diagonal_m = std::sqrt(0.5) * cell_m;
    const auto range = [&](double a, double b, double count) {
      const double low = (std::min(a, b) - half_width_m_) / cell_m;
      const double high = (std::max(a, b) + half_width_m_) / cell_m;
      return IndexRange{.first = static_cast<std::int32_t>(
                            std::clamp(std::floor(low), 0.0, count)),
                        .last = static_cast<std::int32_t>(
                            std::clamp(std::floor(high), -1.0, count - 1.0)),
                        .inside = low >= 0 && high <= count};
    };
    const auto rows =
        range(swept.from.north_m, swept.to.north_m, local.cells_north());
    const auto columns =
        range(swept.from.east_m, swept.to.east_m, local.cells_east());
    on_activity_ |= rows.first <= rows.last && columns.first <= columns.last;
    for (std::int32_t i = rows.first; i <= rows.last; ++i) {
      const auto [first, last] =
          ColumnsOf(swept, i * cell_m, (i + 1) * cell_m, cell_m);
      for (std::int32_t j = std::max(columns.first, first);
           j <= std::min(columns.last, last); ++j) {
        const PlanePoint middle = {.north_m = (i + 0.5) * cell_m,
                                   .east_m = (j + 0.5) * cell_m};
        const double apart_m = swept.DistanceTo(middle);
        if (apart_m > half_width_m_ + half_diagonal_m) continue;
        if (apart_m > half_width_m_ + 0.5 * cell_m &&
            !swept.Touches(SquareAt(middle, cell_m), 0.0)) {
          continue;
        }
        const CellIndex cell = {.i = i, .j = j};
        PlacedCell placed = {.middle = local.CellCenter(cell),
                             .along_m = swept.Along(middle),
                             .half_m = half_width_m_ + half_diagonal_m};
        // Alone, a measured cell needs no look at the other layers.
        if (open_.size() == 1) {
          const auto own = local.AtCell(cell);
          if (own.has_value() && own->kind == EvidenceKind::kMeasured) {
            Judge(placed, SeabedEstimate{.estimate = *own,
                                         .local = true,
                                         .activity = &activity.id});
            if (!status_.ok()) return false;
            continue;
          }
        }
        Judge(placed, view_.SeabedAt(placed.middle));
        if (!status_.ok()) return false;
      }
    }
    return rows.inside && columns.inside;
  }

  static PlaneQuad SquareAt(const PlanePoint& middle, double side_m) {
    const double h = 0.5 * side_m;
    return {middle + PlanePoint{-h, -h}, middle + PlanePoint{h, -h},
            middle + PlanePoint{h, h}, middle + PlanePoint{-h, h}};
  }

  // The columns that the swept places between two norths may touch, and a few
  // more: those of the segment cut to these norths, w wider.
  std::pair<std::int32_t, std::int32_t> ColumnsOf(const Stadium& swept,
                                                  double south_m,
                                                  double north_m,
                                                  double cell_m) const {
    double low_share = 0;
    double high_share = 1;
    const double climb_m = swept.to.north_m - swept.from.north_m;
    if (std::fabs(climb_m) > 1e-9) {
      double a = (south_m - half_width_m_ - swept.from.north_m) / climb_m;
      double b = (north_m + half_width_m_ - swept.from.north_m) / climb_m;
      if (a > b) std::swap(a, b);
      low_share = std::clamp(a, 0.0, 1.0);
      high_share = std::clamp(b, 0.0, 1.0);
    }
    const double run_m = swept.to.east_m - swept.from.east_m;
    const double a = swept.from.east_m + low_share * run_m;
    const double b = swept.from.east_m + high_share * run_m;
    constexpr double kFar = 1e9;  // Beyond any grid, within an int.
    const auto column = [&](double east_m) {
      return static_cast<std::int32_t>(
          std::floor(std::clamp(east_m / cell_m, -kFar, kFar)));
    };
    return {column(std::min(a, b) - half_width_m_),
            column(std::max(a, b) + half_width_m_)};
  }

  // Judges the leaves on the piece. `covering_cell_m`: the cell size of an
  // activity that holds the whole piece, else infinite.
  void CheckGlobal(const LegPiece& piece, double covering_cell_m) {
    const GlobalMapView& global = view_.global();
    const RootSquare& root = global.root();
    const bool covered = std::isfinite(covering_cell_m);
    const Stadium swept = {.from = ToPlane(piece.frame->ToNed(piece.from)),
                           .to = ToPlane(piece.frame->ToNed(piece.to)),
                           .half_width_m = half_width_m_};
    const PlaneQuad around = swept.Box();
    std::array<GeodeticPoint, 4> corners;
    bool inside = true;
    for (std::size_t k = 0; k < 4; ++k) {
      corners[k] = piece.frame->ToGeodetic(around[k].north_m, around[k].east_m);
      inside = inside && root.LocateLattice(corners[k]).has_value();
    }
    if (!inside && !covered) {
      // What lies beyond the mission's square is unknown.
      Judge({.middle = piece.from,
             .along_m = 0,
             .half_m = swept.length_m() + half_width_m_},
            std::nullopt);
    }
    const std::optional<LatticeBox> box = root.BoxAround(corners);
    if (!box.has_value() || !status_.ok()) return;
    const auto skip = [&](const TileTotals& tile) {
      return check_.skip_deep && !covered && !on_activity_ &&
             CannotMatter(tile);
    };
    const auto judge = [&](const CellKey& cell, const Leaf& leaf) {
      if (!status_.ok()) return;
      const double side_m = root.cell_size_m(cell.level);
      if (covered && side_m >= covering_cell_m) return;
      const GeodeticPoint middle = root.Center(cell);
      const PlanePoint at = ToPlane(piece.frame->ToNed(middle));
      const double apart_m = swept.DistanceTo(at);
      // Cells differ by less than a tenth from side_m.
      const double half_diagonal_m = 0.75 * 1.1 * side_m;
      if (apart_m > half_width_m_ + half_diagonal_m) return;
      const bool surely = apart_m <= half_width_m_ + 0.4 * side_m;
      std::array<GeodeticPoint, 4> ends;
      if (!surely || on_activity_) ends = root.Corners(cell);
      if (!surely) {
        PlaneQuad quad;
        for (std::size_t k = 0; k < 4; ++k) {
          quad[k] = ToPlane(piece.frame->ToNed(ends[k]));
        }
        const double bow_m = side_m * side_m / (8 * kEarthRadiusM);
        if (!swept.Touches(quad, bow_m)) return;
      }
      const PlacedCell placed = {.middle = middle,
                                 .along_m = swept.Along(at),
                                 .half_m = half_width_m_ + half_diagonal_m};
      const double finer_than_m = on_activity_
                                      ? HeldByActivity(ends)
                                      : std::numeric_limits<double>::infinity();
      if (finer_than_m <= side_m) return;  // Its cells were judged.
      if (covered || std::isfinite(finer_than_m)) {
        Judge(placed, view_.SeabedAt(middle));
      } else if (leaf.known()) {
        Judge(placed,
              SeabedEstimate{.estimate = global.EstimateOf(cell, leaf)});
      } else {
        Judge(placed, std::nullopt);
      }
    };
    global.ForEachLeafIn(*box, judge, skip);
  }

  // True: no leaf of the tile or below it, judged on the piece, changes the
  // verdict: each is FREE, none leaves less water than the leg's least, and
  // none has a greater P than its worst (to the 1e-10 of P's table). A contact
  // near adds to P everywhere: then nothing is skipped.
  bool CannotMatter(const TileTotals& tile) const {
    const LegVerdict& leg = verdict_.legs.back();
    if (!contacts_->empty() || !leg.least_clearance_m.has_value()) return false;
    if (tile.known_leaves < tile.leaves && !trajectory_.unknown_is_free) {
      return false;
    }
    const double first = piece_->ShareOfLeg(0.0);
    const double last = piece_->ShareOfLeg(1.0);
    ObstacleQuery query = query_;
    query.depth_m = std::max(leg_->DepthAt(first), leg_->DepthAt(last));
    query.time = leg_->TimeAt(last);
    const double shoalest_m{tile.shoalest_m};
    // A hazard or land in it ends here.
    if (shoalest_m <= query.depth_m + query.vertical_clearance_m ||
        shoalest_m - query.depth_m < *leg.least_clearance_m) {
      return false;
    }
    // Above the seabed P grows with std and age.
    const DepthEstimate worst = {.depth_m = tile.shoalest_m,
                                 .std_m = tile.largest_std_m,
                                 .kind = EvidenceKind::kMeasured,
                                 .time_s = tile.earliest_s};
    const ObstacleAnswer most =
        SeabedAnswer(query, SeabedEstimate{.estimate = worst});
    return most.state == ObstacleState::kFree &&
           most.probability <= leg.worst_probability;
  }

  // Without contacts.
  ObstacleAnswer SeabedAnswer(
      const ObstacleQuery& query,
      const std::optional<SeabedEstimate>& seabed) const {
    static const ContactsView kNoContacts;
    return Answer(query, seabed, kNoContacts,
                  {.ageing_rate_m2_s = view_.ageing_rate_m2_s()});
  }

  // The least cell size of the open activities that hold all four corners;
  // infinite if none does.
  double HeldByActivity(const std::array<GeodeticPoint, 4>& corners) const {
    double cell_m = std::numeric_limits<double>::infinity();
    for (const ActivityView* activity : open_) {
      if (!activity->local->frame().Covers(corners[0])) continue;
      const bool holds = std::all_of(corners.begin(), corners.end(),
                                     [activity](const GeodeticPoint& p) {
                                       return activity->local->Contains(p);
                                     });
      if (holds) cell_m = std::min(cell_m, activity->options.cell_size_m);
    }
    return cell_m;
  }

  // Judges one cell at the worst depth while the disc may touch it.
  void Judge(const PlacedCell& cell,
             const std::optional<SeabedEstimate>& seabed) {
    if (++verdict_.cells > check_.most_cells) {
      status_ = absl::ResourceExhaustedError(absl::StrFormat(
          "the trajectory sweeps more than %u cells of the map; ask for fewer "
          "or shorter legs at a time",
          check_.most_cells));
      return;
    }
    if (verdict_.cells % kCellsPerLook == 0 && check_.stop != nullptr &&
        check_.stop->load(std::memory_order_relaxed)) {
      status_ = absl::CancelledError("the check was stopped");
      return;
    }
    const double length_m = piece_->length_m;
    const auto share = [&](double along_m) {
      return length_m > 0 ? std::clamp(along_m / length_m, 0.0, 1.0) : 0.0;
    };
    const double first = piece_->ShareOfLeg(share(cell.along_m - cell.half_m));
    const double last =
        length_m > 0 ? piece_->ShareOfLeg(share(cell.along_m + cell.half_m))
                     : piece_->ShareOfLeg(1.0);
    query_.time = leg_->TimeAt(first);
    query_.position = cell.middle;
    query_.depth_m = std::max(leg_->DepthAt(first), leg_->DepthAt(last));
    Weigh(seabed, cell.middle);
  }

  // Answers query_ and enters the answer into the verdict. `place`: of a
  // conflict.
  void Weigh(const std::optional<SeabedEstimate>& seabed,
             const GeodeticPoint& place) {
    ObstacleAnswer answer = SeabedAnswer(query_, seabed);
    if (!contacts_->empty()) contacts_->AddTo(query_, answer);
    LegVerdict& leg = verdict_.legs.back();
    leg.worst_probability = std::max(leg.worst_probability, answer.probability);
    if (answer.seabed.has_value()) {
      const DepthEstimate& estimate = answer.seabed->estimate;
      const double clearance_m =
          estimate.kind == EvidenceKind::kLand
              ? -std::numeric_limits<double>::infinity()
              : double{estimate.depth_m} - query_.depth_m;
      leg.least_clearance_m =
          std::min(leg.least_clearance_m.value_or(clearance_m), clearance_m);
    }
    const bool unknown = answer.state == ObstacleState::kUnknown;
    if (unknown && trajectory_.unknown_is_free) return;
    if (Badness(answer.state) > Badness(leg.state)) leg.state = answer.state;
    const bool hazard =
        answer.seabed.has_value() &&
        ReachesHazard(answer.seabed->estimate,
                      query_.depth_m + query_.vertical_clearance_m);
    if (!unknown && !hazard && answer.state != ObstacleState::kOccupied) return;
    std::optional<Conflict>& first = verdict_.first_conflict;
    if (first.has_value() && first->time <= query_.time) return;
    first = {.leg = leg_index_,
             .position = place,
             .depth_m = query_.depth_m,
             .time = query_.time,
             .answer = std::move(answer)};
  }

  const ObstacleMapView& view_;
  const Trajectory& trajectory_;
  const TrajectoryCheck& check_;
  const std::vector<const ActivityView*>& open_;  // The newest first.
  const double half_width_m_;
  const double finest_leaf_m_;
  TrajectoryVerdict verdict_;
  std::set<const Contact*> met_;  // Contacts near any leg.
  absl::Status status_;
  // What is being judged.
  ObstacleQuery query_;
  std::uint32_t leg_index_ = 0;
  const TimedLeg* leg_ = nullptr;
  const LegPiece* piece_ = nullptr;
  bool on_activity_ = false;  // The piece reaches into an open one's grid.
  std::optional<LegContacts> contacts_;
};

}  // namespace

absl::StatusOr<TrajectoryVerdict> CheckTrajectory(
    const ObstacleMapView& view, const Trajectory& trajectory,
    const TrajectoryCheck& check) {
  FATHOM_RETURN_IF_ERROR(ValidateTrajectory(trajectory));
  return Checker(view, trajectory, check).Run();
}

}  // namespace fathom::map
