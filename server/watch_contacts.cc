#include "server/watch_contacts.h"

#include <cstddef>
#include <cstdint>

#include "map/contacts/contact.h"
#include "server/convert_common.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

void WriteContactOf(const map::ContactKey& key,
                    const map::ObstacleMapView& view,
                    v1::ContactEstimate* out) {
  const map::Contact* contact = view.contacts().Find(key);
  if (contact != nullptr) {
    WriteContact(contact->NewestEstimate(), out);
  } else {
    // Gone from the list, so dropped before that.
    out->set_source_id(key.source.value);
    out->set_contact_id(key.contact.value);
    out->set_status(v1::CONTACT_STATUS_DROPPED);
  }
}

}  // namespace

bool ContactsWatch::WriteContacts(const map::ObstacleMapView& view,
                                  SteadyTime now, Response* out) {
  const size_t most = batched_ ? kEstimatesPerBatch : 1;
  size_t count = 0;
  for (; count < most && !marks_.empty(); ++count) {
    const auto key =
        log_->ContactOf(static_cast<uint32_t>(marks_.Take()), seen_);
    if (!key.has_value()) break;
    WriteContactOf(*key, view,
                   batched_ ? out->mutable_batch()->add_estimates()
                            : out->mutable_estimate());
  }
  if (count == 0) return false;
  WriteStamp(view, out->mutable_stamp());
  if (batched_ && marks_.empty()) {
    progress_.Say(view, log_->run(), now,
                  out->mutable_batch()->mutable_progress());
  } else {
    progress_.Told();
  }
  return true;
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
      progress_.Say(*read.view, log_->run(), now, out->mutable_progress());
      WriteStamp(*read.view, out->mutable_stamp());
      return WatchStep::kMessage;
    }
    if (WriteContacts(*read.view, now, out)) return WatchStep::kMessage;
  }
}

}  // namespace fathom::server
