#include "map/contacts/track_history.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace fathom::map {
namespace {

// The variance of the place in the direction in which it is least.
double LeastVariance(const Eigen::Matrix4d& P) {
  const double half = 0.5 * (P(0, 0) - P(1, 1));
  return 0.5 * (P(0, 0) + P(1, 1)) - std::sqrt(half * half + P(0, 1) * P(0, 1));
}

// Whether what is not motion stays as it was, but for the depth.
bool SameKind(const ContactPoint& a, const ContactPoint& b) {
  return a.contact_class == b.contact_class && a.status == b.status &&
         a.radius_m == b.radius_m;
}

bool SameDepths(const ContactPoint& a, const ContactPoint& b) {
  const double within_m = std::min(a.depth_std_m, b.depth_std_m);
  return a.depth_std_m == b.depth_std_m &&
         std::fabs(a.top_depth_m - b.top_depth_m) <= within_m &&
         std::fabs(a.keel_depth_m - b.keel_depth_m) <= within_m;
}

// Whether `point` is not needed between `before`, the last that is, and `next`:
// see OlderEstimates::Next.
bool IsPassedOver(const ContactPoint& before, const ContactPoint& point,
                  const ContactPoint& next, const ContactClassTable& classes) {
  return GoesOn(before, point) && GoesOn(point, next) &&
         SameKind(before, point) && SameDepths(before, point) &&
         MaySkip(before, next, classes);
}

// Which of the points go: see OlderEstimates::Next.
std::array<bool, kOlderEstimates> Superfluous(const OlderEstimates& points) {
  std::vector<std::pair<double, std::size_t>> ranked;
  const Time newest = points.newest().time;
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (!GoesOn(points[i - 1], points[i]) ||
        !GoesOn(points[i], points[i + 1]) ||
        !SameKind(points[i - 1], points[i])) {
      continue;
    }
    const double gap_s = ToSeconds(points[i + 1].time - points[i - 1].time);
    // Never 0: points may be of one time.
    const double age_s = ToSeconds(newest - points[i].time) + 1e-6;
    ranked.emplace_back(gap_s / age_s, i);
  }
  std::sort(ranked.begin(), ranked.end());
  std::array<bool, kOlderEstimates> goes = {};
  std::size_t count = 0;
  for (const auto& [gap, i] : ranked) {
    if (goes[i - 1] || goes[i + 1]) continue;
    goes[i] = true;
    if (++count == kLetGo) break;
  }
  for (std::size_t i = 0; count < kLetGo; ++i) {
    if (!goes[i]) ++count;
    goes[i] = true;
  }
  return goes;
}

}  // namespace

bool MaySkip(const ContactPoint& from, const ContactPoint& to,
             const ContactClassTable& classes) {
  if (from.contact_class != to.contact_class) return false;
  const double q =
      classes[static_cast<std::size_t>(from.contact_class)].process_noise_m2_s3;
  const double step_s = ToSeconds(to.time - from.time);
  const double wander_m2 = q * step_s * step_s * step_s;
  return wander_m2 <= kSkippedShare * LeastVariance(from.P) &&
         wander_m2 <= kSkippedShare * LeastVariance(to.P);
}

template <std::size_t kMost>
std::optional<std::size_t> EstimateLog<kMost>::NewestAtOrBefore(Time t) const {
  // The usual question is about now or later.
  if (this->empty()) return std::nullopt;
  if (this->newest().time <= t) return this->size() - 1;
  std::size_t low = 0;  // Points below are at or before t.
  std::size_t high = this->size() - 1;
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if ((*this)[middle].time <= t) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == 0) return std::nullopt;
  return low - 1;
}

template class EstimateLog<kRecentEstimates>;
template class EstimateLog<kOlderEstimates>;

void OlderEstimates::Next(const TrackHistory& history, const ContactPoint& next,
                          const ContactClassTable& classes) {
  if (history.empty()) return;
  const std::size_t last = history.size() - 1;
  const ContactPoint* before = nullptr;
  if (last_needed_ > 0) {
    before = &history[last_needed_ - 1];
  } else if (!empty()) {
    before = &newest();
  }
  if (before == nullptr ||
      !IsPassedOver(*before, history[last], next, classes)) {
    needed_.set(last);
    last_needed_ = last + 1;
  }
  if (history.size() < kRecentEstimates) return;
  if (needed_.test(0)) {
    if (size() == kOlderEstimates) LetGo();
    Append(history[0]);
  }
  needed_ >>= 1;
  if (last_needed_ > 0) --last_needed_;
}

void OlderEstimates::Truncate(std::size_t size) {
  // Whether the last is needed shows when one comes after it.
  for (std::size_t i = size == 0 ? 0 : size - 1; i < last_needed_; ++i) {
    needed_.reset(i);
  }
  while (last_needed_ > 0 && !needed_.test(last_needed_ - 1)) --last_needed_;
}

void OlderEstimates::LetGo() {
  const auto goes = Superfluous(*this);
  std::vector<ContactPoint> kept;
  kept.reserve(size());
  for (std::size_t i = 0; i < size(); ++i) {
    const ContactPoint& point = (*this)[i];
    if (!goes[i]) {
      kept.push_back(point);
    } else if (!kept.empty() && GoesOn(kept.back(), point)) {
      ContactPoint& before = kept.back();
      before.top_depth_m = std::min(before.top_depth_m, point.top_depth_m);
      before.keel_depth_m = std::max(before.keel_depth_m, point.keel_depth_m);
      before.depth_std_m = std::max(before.depth_std_m, point.depth_std_m);
    }
  }
  static_cast<EstimateLog&>(*this) = {};
  for (const ContactPoint& point : kept) Append(point);
}

}  // namespace fathom::map
