#include "map/contacts/spatial_index.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/base/macros.h"
#include "map/contacts/contacts_view.h"

namespace fathom::map {
namespace {

// A leaf of more entries divides.
constexpr std::size_t kLeafEntries = 16;

// Two bits a level. 20 levels: cells of 20 m; more contacts than kLeafEntries
// in one stay together.
constexpr int kLevels = 20;

// Which child of a node at `level` (0: the root) holds the code.
std::size_t ChildAt(std::uint64_t code, int level) {
  return static_cast<std::size_t>(code >> (2 * (kLevels - 1 - level))) & 3u;
}

// The lower 20 bits of x, a zero behind each.
std::uint64_t Spread(std::uint64_t x) {
  x = (x | (x << 16)) & 0x0000ffff0000ffffu;
  x = (x | (x << 8)) & 0x00ff00ff00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0f0f0f0f0fu;
  x = (x | (x << 2)) & 0x3333333333333333u;
  return (x | (x << 1)) & 0x5555555555555555u;
}

std::uint64_t ToCode(const GeodeticPoint& point) {
  constexpr double kCells = 1 << kLevels;
  const auto index = [](double part) {
    return static_cast<std::uint64_t>(
        std::clamp(part * kCells, 0.0, kCells - 1.0));
  };
  return Spread(index((point.latitude_deg + 90.0) / 180.0)) << 1 |
         Spread(index((point.longitude_deg + 180.0) / 360.0));
}

// std::hypot guards against overflow, of which nothing here comes near, and is
// ten times as dear.
double Length(double a, double b) { return std::sqrt(a * a + b * b); }

// The greatest 1 sigma in any direction of the 2x2 covariance at `first`.
double GreatestStd(const Eigen::Matrix4d& P, int first) {
  const double mean = 0.5 * (P(first, first) + P(first + 1, first + 1));
  const double half = 0.5 * (P(first, first) - P(first + 1, first + 1));
  return std::sqrt(mean + Length(half, P(first, first + 1)));
}

// After how many reports the reach into the past is made afresh, over the
// newest estimates and over the older ones.
constexpr std::uint64_t kAfresh = 128;
constexpr std::uint64_t kOlderAfresh = 512;

// Whether a multiple of `step` is among the newest `appended` of `count`.
bool Crosses(std::uint64_t count, std::uint64_t appended, std::uint64_t step) {
  return count / step != (count - appended) / step;
}

// A little more than the value, to cover the rounding to float.
float Above(double value) { return static_cast<float>(value * 1.000001); }

double DistanceM(const UnitVector& a, const UnitVector& b) {
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += d * d;
  }
  return std::sqrt(sum) * 6'400'000.0 + 2.0;
}

// What SpatialBounds says of one estimate predicted on by up to dt_s.
struct Reach {
  double base_m;
  double speed_m_s;
  double wander_m_s15;
  double After(double dt_s) const {
    return base_m + dt_s * speed_m_s + dt_s * std::sqrt(dt_s) * wander_m_s15;
  }
};

Reach ReachOf(const ContactPoint& point, const ContactClassTable& classes) {
  const double q = classes[static_cast<std::size_t>(point.contact_class)]
                       .process_noise_m2_s3;
  return {.base_m = point.radius_m + kNearSigmas * GreatestStd(point.P, 0),
          .speed_m_s = Length(point.x(2), point.x(3)) +
                       kNearSigmas * GreatestStd(point.P, 2),
          .wander_m_s15 = kNearSigmas * std::sqrt(q / 3.0)};
}

// Between two estimates the past is smoothed: it may lie where neither said.
// By how much the reach of the first is widened: what came later moves it by
// no more than kGateSigmas or so (12.5 / 7.5), and a fix draws it along by what
// it was off.
constexpr double kSmoothedReach = 1.7;
constexpr double kSmoothedDraw = 1.5;

// How far from `point`, which reaches as told, the contact may be found until
// `next` came.
double ReachUntil(const ContactPoint& point, const Reach& reach,
                  const ContactPoint& next) {
  const double span_s = ToSeconds(next.time - point.time);
  const double draw_m =
      point.frame_origin == next.frame_origin
          ? (next.x.head<2>() - point.x.head<2>() - span_s * point.x.tail<2>())
                .norm()
          : DistanceM(ToUnitVector(next.Position()),
                      ToUnitVector(point.Position())) +
                span_s * point.x.tail<2>().norm();
  return kSmoothedReach * reach.After(span_s) + kSmoothedDraw * draw_m;
}

// How far from `newest`, which is at `place`, the contact may have been until
// `next` came after `point`. `back`: and before it, back to the start of its
// life.
double PastOf(const ContactPoint& point, const ContactPoint* next, bool back,
              const ContactPoint& newest, const UnitVector& place,
              const ContactClassTable& classes) {
  const Reach reach = ReachOf(point, classes);
  double reach_m = next == nullptr ? 0 : ReachUntil(point, reach, *next);
  if (back) {
    reach_m = std::max(reach_m,
                       reach.After(ToSeconds(point.time - point.track_start)));
  }
  // On one plane the difference will do (1.1: what the plane shortens).
  return reach_m +
         (point.frame_origin == newest.frame_origin
              ? 1.1 * Length(point.x(0) - newest.x(0), point.x(1) - newest.x(1))
              : DistanceM(place, ToUnitVector(point.Position())));
}

// SpatialBounds::past_m: each estimate is asked until the next one came.
double PastAfresh(const Contact& contact, const UnitVector& place,
                  const ContactClassTable& classes) {
  const TrackHistory& history = contact.history();
  double past_m = 0;
  for (std::size_t i = 0; i < history.size(); ++i) {
    const ContactPoint* const next =
        i + 1 < history.size() ? &history[i + 1] : nullptr;
    const bool back = i == 0 && contact.older().empty();
    past_m = std::max(past_m, PastOf(history[i], next, back, history.newest(),
                                     place, classes));
  }
  return past_m;
}

// The same from the entry before the newest `appended` came, at least as wide.
// REQUIRES: appended < history.size().
double PastFrom(const TrackHistory& history, std::size_t appended,
                const SpatialEntry& before, double moved_m,
                const UnitVector& place, const ContactClassTable& classes) {
  const std::size_t last = history.size() - 1 - appended;
  // What ReachOf(history[last]) said, rounded up; of a drop, where it is
  // nowhere, 0.
  const Reach reach{.base_m = before.bounds.base_m,
                    .speed_m_s = before.bounds.speed_m_s,
                    .wander_m_s15 = before.bounds.wander_m_s15};
  double past_m =
      moved_m + std::max(static_cast<double>(before.bounds.past_m),
                         ReachUntil(history[last], reach, history[last + 1]));
  for (std::size_t i = last + 1; i + 1 < history.size(); ++i) {
    past_m = std::max(past_m, PastOf(history[i], &history[i + 1], false,
                                     history.newest(), place, classes));
  }
  return past_m;
}

// SpatialBounds::older_m.
double OlderAfresh(const Contact& contact, const UnitVector& place,
                   const ContactClassTable& classes) {
  const OlderEstimates& older = contact.older();
  const TrackHistory& history = contact.history();
  double older_m = 0;
  for (std::size_t i = 0; i < older.size(); ++i) {
    const ContactPoint& next = i + 1 < older.size() ? older[i + 1] : history[0];
    older_m = std::max(older_m, PastOf(older[i], &next, i == 0,
                                       history.newest(), place, classes));
  }
  return older_m;
}

// The same from the entry before, at least as wide. What became older is where
// it was, and to pass over some moves the answer by much less than
// kSmoothedReach allows (track_history.h).
double OlderFrom(const SpatialEntry& before, double moved_m) {
  return moved_m + static_cast<double>(
                       std::max(before.bounds.past_m, before.bounds.older_m));
}

// ToUnitVector in single precision, within 1.6 m: half a unit of a longitude's
// last place is 0.8 m, of a latitude's 0.4 m, the rest the functions' own.
UnitVector QuickUnitVector(const GeodeticPoint& point) {
  constexpr double kRadPerDeg = std::numbers::pi / 180.0;
  const auto lat = static_cast<float>(point.latitude_deg * kRadPerDeg);
  const auto lon = static_cast<float>(point.longitude_deg * kRadPerDeg);
  const float cos_lat = std::cos(lat);
  return {cos_lat * std::cos(lon), cos_lat * std::sin(lon), std::sin(lat)};
}

}  // namespace

UnitVector ToUnitVector(const GeodeticPoint& point) {
  constexpr double kRadPerDeg = std::numbers::pi / 180.0;
  const double cos_lat = std::cos(point.latitude_deg * kRadPerDeg);
  return {
      static_cast<float>(cos_lat * std::cos(point.longitude_deg * kRadPerDeg)),
      static_cast<float>(cos_lat * std::sin(point.longitude_deg * kRadPerDeg)),
      static_cast<float>(std::sin(point.latitude_deg * kRadPerDeg))};
}

void SpatialBounds::Include(const SpatialBounds& other) {
  for (std::size_t i = 0; i < 3; ++i) {
    low[i] = std::min(low[i], other.low[i]);
    high[i] = std::max(high[i], other.high[i]);
  }
  base_m = std::max(base_m, other.base_m);
  speed_m_s = std::max(speed_m_s, other.speed_m_s);
  wander_m_s15 = std::max(wander_m_s15, other.wander_m_s15);
  past_m = std::max(past_m, other.past_m);
  older_m = std::max(older_m, other.older_m);
  least_wander_m_s15 = std::min(least_wander_m_s15, other.least_wander_m_s15);
  radius_m = std::max(radius_m, other.radius_m);
  oldest = std::min(oldest, other.oldest);
  newest = std::max(newest, other.newest);
  all_since = std::max(all_since, other.all_since);
}

bool SpatialBounds::MayReach(const UnitVector& at, double reach_m,
                             Time t) const {
  float sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const float d = std::max({low[i] - at[i], at[i] - high[i], 0.0f});
    sum += d * d;
  }
  double within_m = 0.0;
  if (t >= oldest) {
    const double dt_s = ToSeconds(t - oldest);
    within_m = static_cast<double>(base_m) +
               dt_s * (static_cast<double>(speed_m_s) +
                       std::sqrt(dt_s) * static_cast<double>(wander_m_s15));
  }
  if (t < newest) within_m = std::max(within_m, static_cast<double>(past_m));
  if (t < all_since) {
    within_m = std::max(within_m, static_cast<double>(older_m));
  }
  // 3 m: the rounding of the unit vectors.
  const double room_m = reach_m + within_m + 3.0;
  constexpr double kRadius2 =
      static_cast<double>(kPlaneRadiusM) * static_cast<double>(kPlaneRadiusM);
  if (static_cast<double>(sum) * kRadius2 > room_m * room_m) return false;
  if (t < newest) return true;
  // Each axis has a variance of q T^3 / 3 at least.
  const double silent_s = ToSeconds(t - newest);
  const double wander = static_cast<double>(least_wander_m_s15) / kNearSigmas;
  const double radius = static_cast<double>(radius_m) + reach_m;
  return 0.5 * radius * radius >=
         kVanishing * wander * wander * silent_s * silent_s * silent_s;
}

SpatialEntry MakeSpatialEntry(const Contact& contact,
                              const ContactClassTable& classes,
                              const std::optional<SpatialEntry>& before,
                              std::size_t appended) {
  const TrackHistory& history = contact.history();
  const ContactPoint& newest = history.newest();
  const GeodeticPoint place = newest.Position();
  const Reach reach = ReachOf(newest, classes);
  SpatialEntry entry{.contact = &contact, .code = ToCode(place), .bounds = {}};
  SpatialBounds& bounds = entry.bounds;
  bounds.low = bounds.high = ToUnitVector(place);
  bounds.oldest = bounds.newest = newest.time;
  bounds.radius_m = Above(newest.radius_m);
  bounds.least_wander_m_s15 = static_cast<float>(reach.wander_m_s15 * 0.999999);
  // From a drop on it is nowhere.
  if (newest.status != ContactStatus::kDropped) {
    bounds.base_m = Above(reach.base_m);
    bounds.speed_m_s = Above(reach.speed_m_s);
    bounds.wander_m_s15 = Above(reach.wander_m_s15);
  }
  // Of more than are kept, some left unseen.
  const bool follows = before.has_value() && appended < history.size();
  const double moved_m =
      follows ? DistanceM(bounds.low, before->bounds.low) : 0.0;
  bounds.past_m = Above(
      follows && !Crosses(newest.report_count, appended, kAfresh)
          ? PastFrom(history, appended, *before, moved_m, bounds.low, classes)
          : PastAfresh(contact, bounds.low, classes));
  if (contact.older().empty()) return entry;
  bounds.older_m =
      Above(follows && !Crosses(newest.report_count, appended, kOlderAfresh)
                ? OlderFrom(*before, moved_m)
                : OlderAfresh(contact, bounds.low, classes));
  bounds.all_since = history[0].time;
  return entry;
}

struct SpatialIndex::Node {
  std::uint64_t epoch = 0;
  SpatialBounds bounds;
  // `bounds` are of what is there. If not, nor is the node above, and both are
  // of the current epoch.
  bool settled = false;
  bool leaf = true;
  std::array<std::shared_ptr<Node>, 4> children;
  std::vector<SpatialEntry> entries;

  void Bound() {
    bounds = {};
    for (const SpatialEntry& entry : entries) bounds.Include(entry.bounds);
    for (const auto& child : children) {
      if (child != nullptr) bounds.Include(child->bounds);
    }
  }
  bool Empty() const {
    return entries.empty() &&
           std::all_of(children.begin(), children.end(),
                       [](const auto& child) { return child == nullptr; });
  }
};

SpatialIndex::Node& SpatialIndex::Own(std::shared_ptr<Node>& node,
                                      std::uint64_t epoch) {
  if (node == nullptr) {
    node = std::make_shared<Node>();
    node->epoch = epoch;
  } else if (node->epoch != epoch) {
    node = std::make_shared<Node>(*node);
    node->epoch = epoch;
  }
  node->settled = false;
  return *node;
}

void SpatialIndex::Settle(Node& node) {
  if (node.settled) return;
  for (const auto& child : node.children) {
    if (child != nullptr) Settle(*child);
  }
  node.Bound();
  node.settled = true;
}

void SpatialIndex::Settle() {
  if (root_ != nullptr) Settle(*root_);
  top_ = root_.get();
  while (top_ != nullptr && !top_->leaf) {
    const Node* only = nullptr;
    for (const auto& child : top_->children) {
      if (child == nullptr) continue;
      if (only != nullptr) return;
      only = child.get();
    }
    top_ = only;
  }
}

void SpatialIndex::Insert(const SpatialEntry& entry, std::uint64_t epoch) {
  top_ = nullptr;
  std::shared_ptr<Node>* slot = &root_;
  int level = 0;
  while (true) {
    Node& node = Own(*slot, epoch);
    if (node.leaf) {
      node.entries.push_back(entry);
      if (node.entries.size() <= kLeafEntries || level == kLevels) return;
      node.leaf = false;
      for (const SpatialEntry& moved : node.entries) {
        Node& child = Own(node.children[ChildAt(moved.code, level)], epoch);
        child.entries.push_back(moved);
      }
      node.entries.clear();
      // All of them may have gone to one child: divide that on its turn, when
      // the next entry comes.
      return;
    }
    slot = &node.children[ChildAt(entry.code, level)];
    ++level;
  }
}

std::optional<SpatialEntry> SpatialIndex::Find(const Contact* contact,
                                               std::uint64_t code) const {
  const Node* node = root_.get();
  for (int level = 0; node != nullptr && !node->leaf; ++level) {
    node = node->children[ChildAt(code, level)].get();
  }
  if (node == nullptr) return std::nullopt;
  for (const SpatialEntry& entry : node->entries) {
    if (entry.contact == contact) return entry;
  }
  return std::nullopt;
}

void SpatialIndex::Remove(const Contact* contact, std::uint64_t code,
                          std::uint64_t epoch) {
  Change(contact, code, nullptr, epoch);
}

void SpatialIndex::Replace(const Contact* contact, std::uint64_t code,
                           const SpatialEntry& entry, std::uint64_t epoch) {
  if (!Change(contact, code, &entry, epoch)) Insert(entry, epoch);
}

bool SpatialIndex::Change(const Contact* contact, std::uint64_t code,
                          const SpatialEntry* entry, std::uint64_t epoch) {
  top_ = nullptr;
  bool replaced = false;
  std::array<std::shared_ptr<Node>*, kLevels + 1> path;
  std::size_t depth = 0;
  std::shared_ptr<Node>* slot = &root_;
  while (*slot != nullptr) {
    Node& node = Own(*slot, epoch);
    path[depth++] = slot;
    if (node.leaf) {
      const auto found = std::find_if(
          node.entries.begin(), node.entries.end(),
          [contact](const SpatialEntry& e) { return e.contact == contact; });
      if (found == node.entries.end()) break;
      // What the leaf holds begins alike in so many bits.
      const int differs = 2 * (kLevels + 1 - static_cast<int>(depth));
      replaced =
          entry != nullptr && (entry->code >> differs) == (code >> differs);
      if (replaced) {
        *found = *entry;
      } else {
        node.entries.erase(found);
      }
      break;
    }
    slot = &node.children[ChildAt(code, static_cast<int>(depth) - 1)];
  }
  while (depth > 0 && (*path[depth - 1])->Empty()) path[--depth]->reset();
  return replaced;
}

void SpatialIndex::ForEachCandidate(
    const GeodeticPoint& point, double reach_m, Time t,
    absl::FunctionRef<void(const Contact&)> visit) const {
  // A move leaves top_ behind.
  if (root_ == nullptr) return;
  ABSL_ASSERT(top_ != nullptr);  // Settled.
  const UnitVector at = QuickUnitVector(point);
  // Depth first; at most three siblings wait on each level.
  std::array<const Node*, 3 * kLevels + 4> waiting;
  std::size_t count = 0;
  waiting[count++] = top_;
  while (count > 0) {
    const Node& node = *waiting[--count];
    if (!node.bounds.MayReach(at, reach_m, t)) continue;
    for (const SpatialEntry& entry : node.entries) {
      if (entry.bounds.MayReach(at, reach_m, t)) visit(*entry.contact);
    }
    for (const auto& child : node.children) {
      if (child != nullptr) waiting[count++] = child.get();
    }
  }
}

}  // namespace fathom::map
