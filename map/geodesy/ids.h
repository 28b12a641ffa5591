// Names of activities, sources and contacts: strings that cannot be mixed up.
//
//   ActivityId activity{"survey-3"};
//   absl::flat_hash_map / std::unordered_map keys both work.
//
// The map treats them as opaque bytes and compares them as such; which
// characters and lengths are allowed is the server's limit.

#ifndef FATHOM_MAP_GEODESY_IDS_H_
#define FATHOM_MAP_GEODESY_IDS_H_

#include <compare>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>

namespace fathom::map {

// One kind of name per Tag. Order is that of the bytes, so that whatever is
// listed in order of id is listed alike on every machine.
template <typename Tag>
struct StringId {
  std::string value;

  bool empty() const { return value.empty(); }

  friend bool operator==(const StringId&, const StringId&) = default;
  friend auto operator<=>(const StringId&, const StringId&) = default;

  template <typename H>
  friend H AbslHashValue(H hash, const StringId& id) {
    return H::combine(std::move(hash), id.value);
  }
};

// An observation area that is being surveyed or was (one local map each).
using ActivityId = StringId<struct ActivityIdTag>;

// Who sends: a vehicle's sonar, a C4I feed, a replay.
using SourceId = StringId<struct SourceIdTag>;

// What a source calls a moving obstacle that it tracks.
using ContactId = StringId<struct ContactIdTag>;

// A contact over all sources: two sources may use the same contact id for
// different ships.
struct ContactKey {
  SourceId source;
  ContactId contact;

  friend bool operator==(const ContactKey&, const ContactKey&) = default;
  friend auto operator<=>(const ContactKey&, const ContactKey&) = default;

  template <typename H>
  friend H AbslHashValue(H hash, const ContactKey& key) {
    return H::combine(std::move(hash), key.source, key.contact);
  }
};

}  // namespace fathom::map

template <typename Tag>
struct std::hash<fathom::map::StringId<Tag>> {
  std::size_t operator()(const fathom::map::StringId<Tag>& id) const noexcept {
    return std::hash<std::string>()(id.value);
  }
};

template <>
struct std::hash<fathom::map::ContactKey> {
  std::size_t operator()(const fathom::map::ContactKey& key) const noexcept {
    // 0x9e37... is 2^64 / golden ratio: it keeps (a, b) and (b, a) apart.
    return std::hash<fathom::map::SourceId>()(key.source) *
               std::size_t{0x9e3779b97f4a7c15} +
           std::hash<fathom::map::ContactId>()(key.contact);
  }
};

#endif  // FATHOM_MAP_GEODESY_IDS_H_
