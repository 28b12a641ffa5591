// ChangeOrder: which keys changed, each once, in the order of its last change.
//
// A reader who knows the number of the last change that he saw asks for those
// behind it. A key that changes again moves to the end, so however slow a
// reader is, a key waits for him at most once: all readers share this one
// structure, and each is a number. (The idea is that of a sequence index, as
// in CouchDB's changes feed.)
//
// At most `most` keys are kept. Past that the longest unchanged is forgotten;
// who has not yet seen that change has lost it (Lost) and starts anew.
//
// Not thread-safe.

#ifndef FATHOM_SERVER_CHANGE_ORDER_H_
#define FATHOM_SERVER_CHANGE_ORDER_H_

#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>

#include "absl/container/flat_hash_map.h"

namespace fathom::server {

// Orders changes: by the revision of the map that first showed them, then as
// they were entered.
struct ChangeNumber {
  uint64_t revision = 0;
  uint64_t order = 0;

  // Behind all changes of `revision`.
  static constexpr ChangeNumber After(uint64_t its_revision) {
    return {its_revision, std::numeric_limits<uint64_t>::max()};
  }
  friend auto operator<=>(const ChangeNumber&, const ChangeNumber&) = default;
};

// See file comment. `Place` goes with the key and is made when it is entered.
template <typename Key, typename Place>
class ChangeOrder {
 public:
  explicit ChangeOrder(size_t most) : most_(most) {}

  // Forgets all; changes up to `revision` are past.
  void Restart(uint64_t revision) {
    in_order_.clear();
    numbers_.clear();
    lost_ = ChangeNumber::After(revision);
  }

  // `key` has changed; revisions never fall. `make` gives the place of a key
  // that is not held. O(log n).
  template <typename Make>
  void Enter(const Key& key, uint64_t revision, const Make& make) {
    const ChangeNumber number = {revision, next_order_++};
    const auto held = numbers_.find(key);
    if (held != numbers_.end()) {
      auto node = in_order_.extract(held->second);
      node.key() = number;
      in_order_.insert(in_order_.end(), std::move(node));
      held->second = number;
      return;
    }
    in_order_.emplace_hint(in_order_.end(), number,
                           std::pair<Key, Place>(key, make()));
    numbers_.emplace(key, number);
    if (in_order_.size() <= most_) return;
    const auto oldest = in_order_.begin();
    lost_ = oldest->first;
    numbers_.erase(oldest->second.first);
    in_order_.erase(oldest);
  }

  // Whether a change behind `seen` was forgotten.
  bool Lost(ChangeNumber seen) const { return seen < lost_; }

  // Calls visit(key, place) for the changes behind `seen`, in order.
  template <typename Visit>
  void ForEachAfter(ChangeNumber seen, const Visit& visit) const {
    for (auto it = in_order_.upper_bound(seen); it != in_order_.end(); ++it) {
      visit(it->second.first, it->second.second);
    }
  }

  size_t size() const { return in_order_.size(); }

 private:
  const size_t most_;
  std::map<ChangeNumber, std::pair<Key, Place>> in_order_;
  absl::flat_hash_map<Key, ChangeNumber> numbers_;
  uint64_t next_order_ = 0;
  // The newest change that was forgotten.
  ChangeNumber lost_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CHANGE_ORDER_H_
