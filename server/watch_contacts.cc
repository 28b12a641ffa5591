#include "server/watch_contacts.h"

#include <cstdint>

#include "map/contacts/contact.h"
#include "server/convert_common.h"

namespace fathom::server {

void ContactsWatch::WriteContactOf(const map::ContactKey& key,
                                   const map::ObstacleMapView& view,
                                   Response* out) {
  const map::Contact* contact = view.contacts().Find(key);
  v1::ContactEstimate* estimate = out->mutable_estimate();
  if (contact != nullptr) {
    WriteContact(contact->NewestEstimate(), estimate);
  } else {
    // Gone from the list, so dropped before that.
    estimate->set_source_id(key.source.value);
    estimate->set_contact_id(key.contact.value);
    estimate->set_status(v1::CONTACT_STATUS_DROPPED);
  }
  WriteStamp(view, out->mutable_stamp());
  progress_.Told();
}

absl::StatusOr<WatchStep> ContactsWatch::Next(SteadyTime now,
                                              const std::atomic<bool>&,
                                              Response* out) {
  out->Clear();
  const auto mark = [this](uint32_t number) { marks_.Mark(number); };
  if (!progress_.begun()) {
    seen_ = progress_.Begin(*log_);
    if (progress_.from_start()) seen_ = log_->ReadAllContacts(mark).seen;
  }
  while (true) {
    ChangeLog::Read read = log_->ReadContacts(seen_, mark);
    if (read.lost) {
      marks_.Clear();
      read = log_->ReadAllContacts(mark);
      seen_ = read.seen;
      progress_.SayLost(*read.view, out);
      return WatchStep::kMessage;
    }
    seen_ = read.seen;
    if (marks_.empty()) {
      if (!progress_.Due(*read.view, now)) return WatchStep::kIdle;
      progress_.Say(*read.view, log_->run(), now, out);
      return WatchStep::kMessage;
    }
    const auto key =
        log_->ContactOf(static_cast<uint32_t>(marks_.Take()), seen_);
    if (!key.has_value()) continue;
    WriteContactOf(*key, *read.view, out);
    return WatchStep::kMessage;
  }
}

}  // namespace fathom::server
