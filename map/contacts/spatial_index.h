// Where contacts are and how far each may have got: a quadtree over latitude
// and longitude that skips, whole branches at a time, contacts that cannot
// reach a place at a time.
//
// It only ever skips: each bound is rounded outwards, and whoever asks checks
// the candidates exactly (ContactsView::ForEachNear). So answers do not
// depend on how the tree came about.
//
// Copy on write: nodes made since the last snapshot (same epoch) are changed
// in place, others are copied along the path from the root. One thread
// writes; a snapshot (a copy of the root's pointer) is immutable. Bounds are
// made once for all changes since the snapshot before, by Settle.

#ifndef FATHOM_MAP_CONTACTS_SPATIAL_INDEX_H_
#define FATHOM_MAP_CONTACTS_SPATIAL_INDEX_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "absl/functional/function_ref.h"
#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// Direction of the vertical of a place, Earth-fixed unit vector. Floats hold
// it to 0.4 m.
using UnitVector = std::array<float, 3>;
UnitVector ToUnitVector(const GeodeticPoint& point);

// A lower bound of the distance between two places on any contact's plane
// that holds both, from the distance of their unit vectors: the smallest
// radius of curvature, 6335 km, less 10 % for what a plane shortens within
// kFarthestM and for rounding.
inline constexpr float kPlaneRadiusM = 5'700'000;

// The region of space and time that one contact, or all below a node, may be
// in. At a time t not before `newest` it is within
//   base_m + speed_m_s dt + wander_m_s15 dt^1.5,  dt = t - oldest,
// of the box; at an earlier time within past_m; at one before `all_since`
// within the greater of past_m and older_m.
struct SpatialBounds {
  UnitVector low = {2, 2, 2};
  UnitVector high = {-2, -2, -2};
  // Radius of the disc and kNearSigmas of the position.
  float base_m = 0;
  // Speed and kNearSigmas of it.
  float speed_m_s = 0;
  // kNearSigmas sqrt(q / 3).
  float wander_m_s15 = 0;
  // Over the newest estimates, that is Contact::history; over those before.
  float past_m = 0;
  float older_m = 0;
  // The least wander and the greatest radius of what is inside: after long
  // silence it is too vague to matter anywhere (kVanishing).
  float least_wander_m_s15 = std::numeric_limits<float>::infinity();
  float radius_m = 0;
  // Earliest and latest newest estimate.
  Time oldest = Time::max();
  Time newest = Time::min();
  // Latest begin of the newest estimates of one that has older ones.
  Time all_since = Time::min();

  void Include(const SpatialBounds& other);
  // Whether something in it may at `t` be within reach_m of `at`.
  bool MayReach(const UnitVector& at, double reach_m, Time t) const;
};

// A contact in the tree. The pointer is the tree's holder's to keep valid.
struct SpatialEntry {
  const Contact* contact = nullptr;
  // Its place in the tree: interleaved bits of longitude and latitude.
  std::uint64_t code = 0;
  SpatialBounds bounds;
};

// The entry for a contact. `before`: its entry when the newest `appended`
// estimates had not come, if it had one and nothing else was done to its
// estimates since. What is said of the newest then follows from `before` in
// O(appended), a little wider, but once in 128 reports; what is said of the
// older, but once in 512. Else O(estimates kept).
SpatialEntry MakeSpatialEntry(const Contact& contact,
                              const ContactClassTable& classes,
                              const std::optional<SpatialEntry>& before,
                              std::size_t appended);

class SpatialIndex {
 public:
  // Adds an entry, or takes out the entry of `contact` (which was added with
  // `code`), if it is there. `epoch`: nodes of another epoch are shared with a
  // snapshot and are copied. O(depth). Settle before the next question or
  // snapshot.
  void Insert(const SpatialEntry& entry, std::uint64_t epoch);
  void Remove(const Contact* contact, std::uint64_t code, std::uint64_t epoch);

  // The entry of `contact`; nullopt if it is not there.
  std::optional<SpatialEntry> Find(const Contact* contact,
                                   std::uint64_t code) const;

  // `entry` takes the place of the entry of `contact`: Remove and Insert, on
  // one way where both are in one leaf.
  void Replace(const Contact* contact, std::uint64_t code,
               const SpatialEntry& entry, std::uint64_t epoch);

  // Makes the bounds of what was changed. O(1) a node changed since the last
  // call: a leaf where ten contacts reported is bounded once.
  void Settle();

  // Every contact that may at `t` be within reach_m of `point`, and some that
  // may not; in no particular order. REQUIRES: settled.
  void ForEachCandidate(const GeodeticPoint& point, double reach_m, Time t,
                        absl::FunctionRef<void(const Contact&)> visit) const;

 private:
  struct Node;
  // Takes the entry of `contact` out or, if it belongs into the same leaf, puts
  // `entry` in its place; whether it did that.
  bool Change(const Contact* contact, std::uint64_t code,
              const SpatialEntry* entry, std::uint64_t epoch);
  // Bounds the node and what was changed below it.
  static void Settle(Node& node);
  // The node, or a copy of it that this epoch may change.
  static Node& Own(std::shared_ptr<Node>& node, std::uint64_t epoch);

  std::shared_ptr<Node> root_;
  // The first node below the root that has not one child alone: contacts of
  // one sea share half a dozen nodes that tell them not apart. root_ keeps it.
  // nullptr: there is none, or not settled.
  const Node* top_ = nullptr;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_SPATIAL_INDEX_H_
