#include "map/contacts/contact_set.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace fathom::map {
namespace {

bool KeyBefore(const HeldContact& held, const ContactKey& key) {
  return held.contact->key() < key;
}

}  // namespace

ContactSet::Place ContactSet::Find(const ContactKey& key) const {
  if (blocks.empty()) return {};
  // The last block that begins at or before the key; else the first.
  const auto after = std::upper_bound(
      blocks.begin(), blocks.end(), key,
      [](const ContactKey& wanted, const std::shared_ptr<ContactBlock>& block) {
        return wanted < block->contacts.front().contact->key();
      });
  Place place;
  place.block = after == blocks.begin()
                    ? 0
                    : static_cast<std::size_t>(after - blocks.begin()) - 1;
  const std::vector<HeldContact>& contacts = blocks[place.block]->contacts;
  const auto slot =
      std::lower_bound(contacts.begin(), contacts.end(), key, KeyBefore);
  place.slot = static_cast<std::size_t>(slot - contacts.begin());
  place.found = slot != contacts.end() && slot->contact->key() == key;
  return place;
}

const Contact* ContactSet::Get(const ContactKey& key) const {
  const Place place = Find(key);
  if (!place.found) return nullptr;
  return blocks[place.block]->contacts[place.slot].contact.get();
}

ContactBlock& ContactSet::OwnBlock(std::size_t block) {
  std::shared_ptr<ContactBlock>& held = blocks[block];
  if (held->epoch != epoch) {
    held = std::make_shared<ContactBlock>(*held);
    held->epoch = epoch;
  }
  return *held;
}

const Contact& ContactSet::Change(const Place& place, ContactChange kind,
                                  absl::FunctionRef<void(Contact&)> change) {
  HeldContact& held = OwnBlock(place.block).contacts[place.slot];
  const bool was_live = !held.contact->dropped();
  const std::shared_ptr<Contact> before = held.contact;
  if (held.epoch != epoch) {
    held.contact = std::make_shared<Contact>(*before);
    held.epoch = epoch;
    held.unsettled = 0;
  }
  if (held.unsettled == 0) {
    unsettled.push_back({.contact = held.contact.get(), .indexed = before});
    held.unsettled = unsettled.size();
  }
  UnsettledContact& told = unsettled[held.unsettled - 1];
  const std::size_t older = held.contact->older().size();
  change(*held.contact);
  if (kind == ContactChange::kAppend) ++told.appended;
  told.revised = told.revised || kind == ContactChange::kRevise ||
                 held.contact->older().size() < older;
  if (was_live) --live_count;
  if (!held.contact->dropped()) ++live_count;
  return *held.contact;
}

void ContactSet::Add(std::shared_ptr<Contact> contact) {
  const Place place = Find(contact->key());
  const SpatialEntry entry =
      MakeSpatialEntry(*contact, *classes, std::nullopt, 0);
  index.Insert(entry, epoch);
  contact->set_index_code(entry.code);
  ++size;
  if (!contact->dropped()) ++live_count;
  HeldContact held{.contact = std::move(contact), .epoch = epoch};
  if (blocks.empty()) {
    blocks.push_back(std::make_shared<ContactBlock>());
    blocks.back()->epoch = epoch;
  }
  std::vector<HeldContact>& contacts = OwnBlock(place.block).contacts;
  contacts.insert(contacts.begin() + static_cast<std::ptrdiff_t>(place.slot),
                  std::move(held));
  if (contacts.size() <= kBlockContacts) return;
  auto upper = std::make_shared<ContactBlock>();
  upper->epoch = epoch;
  const auto middle =
      contacts.begin() + static_cast<std::ptrdiff_t>(contacts.size() / 2);
  upper->contacts.assign(std::make_move_iterator(middle),
                         std::make_move_iterator(contacts.end()));
  contacts.erase(middle, contacts.end());
  blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(place.block) + 1,
                std::move(upper));
}

void ContactSet::Erase(const ContactKey& key) {
  const Place place = Find(key);
  ContactBlock& block = OwnBlock(place.block);
  const auto held =
      block.contacts.begin() + static_cast<std::ptrdiff_t>(place.slot);
  const Contact* indexed = held->contact.get();
  if (held->epoch == epoch && held->unsettled > 0) {
    UnsettledContact& told = unsettled[held->unsettled - 1];
    told.contact = nullptr;
    indexed = told.indexed.get();
  }
  index.Remove(indexed, held->contact->index_code(), epoch);
  --size;
  if (!held->contact->dropped()) --live_count;
  block.contacts.erase(held);
  if (block.contacts.empty()) {
    blocks.erase(blocks.begin() + static_cast<std::ptrdiff_t>(place.block));
  }
}

void ContactSet::Settle() {
  for (const UnsettledContact& told : unsettled) {
    if (told.contact == nullptr) continue;
    const std::uint64_t code = told.contact->index_code();
    std::optional<SpatialEntry> entry = index.Find(told.indexed.get(), code);
    if (told.revised) entry.reset();
    if (told.appended > 0 || !entry.has_value()) {
      entry = MakeSpatialEntry(*told.contact, *classes, entry, told.appended);
    }
    entry->contact = told.contact;
    index.Replace(told.indexed.get(), code, *entry, epoch);
    told.contact->set_index_code(entry->code);
  }
  unsettled.clear();
  index.Settle();
}

}  // namespace fathom::map
