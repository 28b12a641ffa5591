// ContactsView: all contacts as they were at one moment of the writer.
//
// Immutable: any number of threads may read it for as long as they hold it.
// Copying costs one reference count.

#ifndef FATHOM_MAP_CONTACTS_CONTACTS_VIEW_H_
#define FATHOM_MAP_CONTACTS_CONTACTS_VIEW_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "absl/functional/function_ref.h"
#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"

namespace fathom::map {

struct ContactSet;  // contact_set.h: how contacts are held; not for callers.

// A contact near a place, at the time asked.
struct NearContact {
  // The contact, of which `predicted` is an estimate; lives with the view.
  const Contact* contact = nullptr;
  ContactPoint predicted;
  // From the place to the predicted position, along the axes of the
  // contact's plane; predicted.P belongs to them.
  double north_m = 0;
  double east_m = 0;
};

// Contacts further than this many sigma outside the reach are not near: each
// could add at most Q(7.5) = 3e-14 to a probability.
inline constexpr double kNearSigmas = 7.5;

// Contacts so vague that P < this for every place asked are near nowhere:
// (radius + reach)^2 / (2 sqrt(det of the position's covariance)) bounds P.
// With the default classes that takes days of silence.
inline constexpr double kVanishing = 1e-10;

// Contacts that would be further than this are never near, whatever their
// uncertainty: their plane folds there, and one so vague has P < 1e-9.
inline constexpr double kFarthestM = 2'500'000;

class ContactsView {
 public:
  ContactsView();
  explicit ContactsView(std::shared_ptr<const ContactSet> set);

  // Contacts held, dropped ones included.
  std::size_t size() const;
  // Contacts not dropped (new, active or stale).
  std::size_t live_count() const;
  std::size_t max_contacts() const;
  const ContactClassTable& classes() const;

  // nullptr if the contact is not held. O(log size).
  const Contact* Find(const ContactKey& key) const;

  // The contact at `t`; absent as Contact::At says, or if it is not held.
  std::optional<ContactEstimate> At(const ContactKey& key, Time t) const;

  // Every contact, dropped ones included, ordered by source, then contact.
  void ForEach(absl::FunctionRef<void(const Contact&)> visit) const;

  // Every contact that at `t` may reach within reach_m of `point`: those
  // whose predicted position less its radius and kNearSigmas standard
  // deviations is nearer than reach_m (but see kVanishing, kFarthestM). In
  // order of key. About 0.5 us for each; far ones are skipped by branches of
  // a tree.
  void ForEachNear(const GeodeticPoint& point, double reach_m, Time t,
                   absl::FunctionRef<void(const NearContact&)> visit) const;

 private:
  friend void DiffContacts(const ContactsView&, const ContactsView&,
                           absl::FunctionRef<void(const Contact&)>,
                           absl::FunctionRef<void(const ContactKey&)>);
  std::shared_ptr<const ContactSet> set_;
};

// What changed between two views of one map, by identity (no content is
// compared): `changed` for each contact that is new or has another history,
// `gone` for each that is no longer held. O(size of the changed pieces).
void DiffContacts(const ContactsView& before, const ContactsView& now,
                  absl::FunctionRef<void(const Contact&)> changed,
                  absl::FunctionRef<void(const ContactKey&)> gone);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACTS_VIEW_H_
