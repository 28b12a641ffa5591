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
  // The copy is found in the index by the one that it is of, which others may
  // have let go.
  const std::shared_ptr<Contact> before = held.contact;
  std::optional<SpatialEntry> entry = index.Find(before.get(), held.code);
  if (held.epoch != epoch) {
    held.contact = std::make_shared<Contact>(*held.contact);
    held.epoch = epoch;
  }
  const std::size_t older = held.contact->older().size();
  change(*held.contact);
  if (kind == ContactChange::kReports && entry.has_value()) {
    entry->contact = held.contact.get();
  } else {
    if (held.contact->older().size() < older) entry.reset();
    entry = MakeSpatialEntry(*held.contact, *classes, entry,
                             kind == ContactChange::kAppend);
  }
  index.Replace(before.get(), held.code, *entry, epoch);
  held.code = entry->code;
  if (was_live) --live_count;
  if (!held.contact->dropped()) ++live_count;
  return *held.contact;
}

void ContactSet::Add(std::shared_ptr<Contact> contact) {
  const Place place = Find(contact->key());
  const SpatialEntry entry =
      MakeSpatialEntry(*contact, *classes, std::nullopt, false);
  index.Insert(entry, epoch);
  ++size;
  if (!contact->dropped()) ++live_count;
  HeldContact held{
      .contact = std::move(contact), .epoch = epoch, .code = entry.code};
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
  index.Remove(held->contact.get(), held->code, epoch);
  --size;
  if (!held->contact->dropped()) --live_count;
  block.contacts.erase(held);
  if (block.contacts.empty()) {
    blocks.erase(blocks.begin() + static_cast<std::ptrdiff_t>(place.block));
  }
}

}  // namespace fathom::map
