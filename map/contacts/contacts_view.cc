#include "map/contacts/contacts_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/container/inlined_vector.h"
#include "map/contacts/contact_set.h"
#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

std::shared_ptr<const ContactSet> EmptySet() {
  auto set = std::make_shared<ContactSet>();
  set->classes =
      std::make_shared<const ContactClassTable>(DefaultContactClasses());
  return set;
}

// A distance through the Earth that on its surface is kFarthestM.
bool BeyondFarthest(const UnitVector& a, const UnitVector& b) {
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += d * d;
  }
  constexpr double kChord = kFarthestM / 6'371'000.0;
  return sum > kChord * kChord;
}

// The exact test behind ContactsView::ForEachNear.
std::optional<NearContact> Near(const Contact& contact,
                                const GeodeticPoint& point, double reach_m,
                                Time t, const ContactClassTable& classes) {
  const std::optional<ContactPoint> predicted = contact.At(t, classes);
  if (!predicted.has_value()) return std::nullopt;
  if (BeyondFarthest(ToUnitVector(predicted->frame_origin),
                     ToUnitVector(point)) ||
      std::hypot(predicted->x(0), predicted->x(1)) > kFarthestM) {
    return std::nullopt;
  }
  const NedPoint place = NedFrame(predicted->frame_origin).ToNed(point);
  NearContact near;
  near.north_m = predicted->x(0) - place.north_m;
  near.east_m = predicted->x(1) - place.east_m;
  const Eigen::Matrix4d& P = predicted->P;
  const double mean = 0.5 * (P(0, 0) + P(1, 1));
  const double greatest_std_m =
      std::sqrt(mean + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1)));
  if (std::hypot(near.north_m, near.east_m) >
      reach_m + predicted->radius_m + kNearSigmas * greatest_std_m) {
    return std::nullopt;
  }
  const double radius_m = reach_m + predicted->radius_m;
  const double det = P(0, 0) * P(1, 1) - P(0, 1) * P(0, 1);
  if (0.5 * radius_m * radius_m < kVanishing * std::sqrt(std::max(0.0, det))) {
    return std::nullopt;
  }
  near.contact = &contact;
  near.predicted = *predicted;
  return near;
}

// Walks the contacts of a set in order of key.
class Walk {
 public:
  explicit Walk(const ContactSet& set) : set_(set) {}
  bool done() const { return block_ == set_.blocks.size(); }
  bool at_block_start() const { return slot_ == 0; }
  const std::shared_ptr<ContactBlock>& block() const {
    return set_.blocks[block_];
  }
  const Contact& contact() const { return *block()->contacts[slot_].contact; }
  void Next() {
    if (++slot_ == block()->contacts.size()) NextBlock();
  }
  void NextBlock() {
    ++block_;
    slot_ = 0;
  }

 private:
  const ContactSet& set_;
  std::size_t block_ = 0;
  std::size_t slot_ = 0;
};

}  // namespace

ContactsView::ContactsView() : set_(EmptySet()) {}

ContactsView::ContactsView(std::shared_ptr<const ContactSet> set)
    : set_(std::move(set)) {}

std::size_t ContactsView::size() const { return set_->size; }
std::size_t ContactsView::live_count() const { return set_->live_count; }
std::size_t ContactsView::max_contacts() const { return set_->max_contacts; }
const ContactClassTable& ContactsView::classes() const {
  return *set_->classes;
}

const Contact* ContactsView::Find(const ContactKey& key) const {
  return set_->Get(key);
}

std::optional<ContactEstimate> ContactsView::At(const ContactKey& key,
                                                Time t) const {
  const Contact* contact = Find(key);
  if (contact == nullptr) return std::nullopt;
  return contact->EstimateAt(t, classes());
}

void ContactsView::ForEach(
    absl::FunctionRef<void(const Contact&)> visit) const {
  for (Walk walk(*set_); !walk.done(); walk.Next()) visit(walk.contact());
}

void ContactsView::ForEachNear(
    const GeodeticPoint& point, double reach_m, Time t,
    absl::FunctionRef<void(const NearContact&)> visit) const {
  absl::InlinedVector<const Contact*, 16> candidates;
  set_->index.ForEachCandidate(point, reach_m, t, [&](const Contact& contact) {
    candidates.push_back(&contact);
  });
  if (candidates.empty()) return;
  // Sums over contacts must not depend on the shape of the index.
  std::sort(
      candidates.begin(), candidates.end(),
      [](const Contact* a, const Contact* b) { return a->key() < b->key(); });
  for (const Contact* contact : candidates) {
    const std::optional<NearContact> near =
        Near(*contact, point, reach_m, t, classes());
    if (near.has_value()) visit(*near);
  }
}

void DiffContacts(const ContactsView& before, const ContactsView& now,
                  absl::FunctionRef<void(const Contact&)> changed,
                  absl::FunctionRef<void(const ContactKey&)> gone) {
  if (before.set_ == now.set_) return;
  Walk old_walk(*before.set_);
  Walk new_walk(*now.set_);
  while (!old_walk.done() || !new_walk.done()) {
    const bool both = !old_walk.done() && !new_walk.done();
    if (both && old_walk.at_block_start() && new_walk.at_block_start() &&
        old_walk.block() == new_walk.block()) {
      old_walk.NextBlock();
      new_walk.NextBlock();
      continue;
    }
    const bool only_old =
        both ? old_walk.contact().key() < new_walk.contact().key()
             : new_walk.done();
    const bool only_new =
        both ? new_walk.contact().key() < old_walk.contact().key()
             : old_walk.done();
    if (only_old) {
      gone(old_walk.contact().key());
      old_walk.Next();
      continue;
    }
    if (only_new || &old_walk.contact() != &new_walk.contact()) {
      changed(new_walk.contact());
    }
    if (!only_new) old_walk.Next();
    new_walk.Next();
  }
}

}  // namespace fathom::map
