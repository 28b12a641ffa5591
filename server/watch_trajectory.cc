#include "server/watch_trajectory.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/status_macros.h"
#include "map/obstacle_map/check_trajectory.h"
#include "server/convert_common.h"
#include "server/convert_trajectory.h"
#include "server/errors.h"
#include "server/field_checks.h"

namespace fathom::server {
namespace {

// Beyond the swept width: the half diagonal of a cell that it touches, of an
// activity (kMaxCellSizeM) or of the global map, whose tiles' boxes hold whole
// cells.
constexpr double kRimM = 0.71 * kMaxCellSizeM;

}  // namespace

bool AlertStands(const map::TrajectoryVerdict& verdict, double confidence,
                 double hysteresis, bool stood) {
  if (verdict.first_conflict.has_value()) return true;
  if (!stood) return false;
  return std::any_of(verdict.legs.begin(), verdict.legs.end(),
                     [&](const map::LegVerdict& leg) {
                       return leg.worst_probability > confidence - hysteresis;
                     });
}

absl::StatusOr<TrajectoryWatch> TrajectoryWatch::Create(
    const v1::WatchTrajectoryRequest& request, const ChangeLog& log,
    uint64_t most_cells) {
  const FieldPath root;
  FATHOM_ASSIGN_OR_RETURN(
      map::Trajectory trajectory,
      ConvertTrajectory(request.trajectory(), FieldPath(root, "trajectory")));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(request.hysteresis(),
                  {.min = 0, .max = 0.5, .unit = "", .upper = Bound::kOpen},
                  FieldPath(root, "hysteresis")));
  return TrajectoryWatch(std::move(trajectory), request.hysteresis(),
                         request.alert_stands(), log, most_cells);
}

TrajectoryWatch::TrajectoryWatch(map::Trajectory trajectory, double hysteresis,
                                 bool alert, const ChangeLog& log,
                                 uint64_t most_cells)
    : log_(&log),
      trajectory_(std::move(trajectory)),
      hysteresis_(hysteresis),
      most_cells_(most_cells),
      alert_(alert) {
  const double reach_m = map::SweptHalfWidthM(trajectory_) + kRimM;
  std::vector<map::GeodeticPoint> places;
  for (const map::Waypoint& waypoint : trajectory_.waypoints) {
    places.push_back(waypoint.position);
  }
  box_ = BoxAround(places, reach_m);
  for (size_t i = 0; i + 1 < places.size(); ++i) {
    legs_.push_back(BoxAround(std::array{places[i], places[i + 1]}, reach_m));
  }
}

ChangeLog::ViewPtr TrajectoryWatch::ReadLog() {
  const ChangeLog::Read areas =
      log_->ReadAreas(seen_areas_, [this](const GeoBox& area) {
        stale_ = stale_ ||
                 (Touch(box_, area) &&
                  std::any_of(legs_.begin(), legs_.end(), [&](const auto& leg) {
                    return Touch(leg, area);
                  }));
      });
  const ChangeLog::Read contacts =
      log_->ReadContacts(seen_contacts_, [this](uint32_t) { stale_ = true; });
  stale_ = stale_ || areas.lost || contacts.lost;
  // Of the two views the older: what came between them is read again.
  const bool older = areas.view->revision() <= contacts.view->revision();
  ChangeLog::ViewPtr view = older ? areas.view : contacts.view;
  seen_areas_ = ChangeNumber::After(view->revision());
  seen_contacts_ = seen_areas_;
  return view;
}

absl::Status TrajectoryWatch::Judge(const map::ObstacleMapView& view,
                                    const std::atomic<bool>& stop) {
  const auto verdict = map::CheckTrajectory(
      view, trajectory_, {.most_cells = most_cells_, .stop = &stop});
  if (absl::IsResourceExhausted(verdict.status())) {
    return TooManyCells("trajectory.waypoints", most_cells_);
  }
  FATHOM_RETURN_IF_ERROR(verdict.status());
  alert_ = AlertStands(*verdict, trajectory_.confidence, hysteresis_, alert_);
  verdict_.Clear();
  WriteVerdict(*verdict, &verdict_);
  words_ = verdict_.SerializeAsString();
  WriteStamp(view, verdict_.mutable_stamp());
  return absl::OkStatus();
}

absl::StatusOr<WatchStep> TrajectoryWatch::Next(SteadyTime now,
                                                const std::atomic<bool>& stop,
                                                Response* out) {
  const ChangeLog::ViewPtr view = ReadLog();
  if (stale_) {
    if (now - judged_ < kTrajectoryInterval) return WatchStep::kSoon;
    FATHOM_RETURN_IF_ERROR(Judge(*view, stop));
    stale_ = false;
    judged_ = now;
  }
  const bool pause_over = now - told_time_ >= kWatchProgressInterval;
  const bool flipped = !told_ || alert_ != told_alert_;
  const bool changed = flipped || words_ != told_words_;
  const bool tell = flipped || (changed && pause_over);
  if (!tell && (!pause_over || view->revision() <= told_revision_)) {
    // A verdict that waits for its second is told by the feed's next wake.
    return WatchStep::kIdle;
  }
  out->Clear();
  out->set_alert(alert_);
  if (tell) {
    *out->mutable_verdict() = verdict_;
    told_words_ = words_;
    told_alert_ = alert_;
    told_ = true;
  } else {
    out->mutable_progress()->set_run_id(log_->run());
  }
  WriteStamp(*view, out->mutable_stamp());
  told_time_ = now;
  told_revision_ = view->revision();
  return WatchStep::kMessage;
}

}  // namespace fathom::server
