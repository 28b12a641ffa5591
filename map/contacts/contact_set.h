// How ContactMap holds its contacts and shares them with views: sorted blocks
// of pointers, copied on write, and a spatial index. Private to this folder.
//
// Everything carries the epoch in which it was made; ContactMap::View() ends
// an epoch. What is of the current epoch is not shared and is changed in
// place, so that many reports between two views copy a piece once.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_SET_H_
#define FATHOM_MAP_CONTACTS_CONTACT_SET_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/functional/function_ref.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/spatial_index.h"

namespace fathom::map {

// A block holds at most this many contacts; a fuller one is halved. A report
// copies one block, a view one pointer a block.
inline constexpr std::size_t kBlockContacts = 128;

struct HeldContact {
  // Shared with views; changed only in its own epoch.
  std::shared_ptr<Contact> contact;
  std::uint64_t epoch = 0;
  // 1 + its place in ContactSet::unsettled, 0: none. Of its own epoch only.
  std::size_t unsettled = 0;
};

// A contact that was changed since the index was told of it.
struct UnsettledContact {
  // nullptr: forgotten since.
  Contact* contact = nullptr;
  // By which the index knows it.
  std::shared_ptr<const Contact> indexed;
  // Estimates appended since; `revised`: other things were done to its history,
  // or older estimates were let go.
  std::size_t appended = 0;
  bool revised = false;
};

// Contacts in order of key; never empty.
struct ContactBlock {
  std::uint64_t epoch = 0;
  std::vector<HeldContact> contacts;
};

// What is done to a contact that is held.
enum class ContactChange {
  kReports,  // To its recent reports only.
  kAppend,   // One point is appended to its history.
  kRevise,   // Anything.
};

struct ContactSet {
  std::uint64_t epoch = 0;
  // In order of key.
  std::vector<std::shared_ptr<ContactBlock>> blocks;
  SpatialIndex index;
  // Of this epoch.
  std::vector<UnsettledContact> unsettled;
  std::size_t size = 0;
  std::size_t live_count = 0;
  std::size_t max_contacts = 0;
  std::shared_ptr<const ContactClassTable> classes;

  // Where the key is or would be inserted: the block (blocks.size() if there
  // is none) and the place in it.
  struct Place {
    std::size_t block = 0;
    std::size_t slot = 0;
    bool found = false;
  };
  Place Find(const ContactKey& key) const;
  const Contact* Get(const ContactKey& key) const;

  // The rest changes the set. REQUIRES: `epoch` is the current one.

  // Lets `change` do to the contact there what `kind` says; returns it.
  // REQUIRES: place.found; a history after it.
  const Contact& Change(const Place& place, ContactChange kind,
                        absl::FunctionRef<void(Contact&)> change);
  // Adds a contact. REQUIRES: its key is not held; a history.
  void Add(std::shared_ptr<Contact> contact);
  // Forgets the contact. REQUIRES: held.
  void Erase(const ContactKey& key);
  // Tells the index what was changed: once a contact, however many reports
  // came about it. To be called before the set is shared; nothing is changed in
  // this epoch after it.
  void Settle();

 private:
  ContactBlock& OwnBlock(std::size_t block);
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_SET_H_
