// What one WatchContacts call is told: each contact that it has not yet been
// told as it is.
//
// As in watch_region.h there is no queue and no view is held: a contact that
// waits is one bit, and told as it is when its turn comes. Who takes batches is
// told all that waits at once, up to kEstimatesPerBatch.
//
// No gRPC. Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_WATCH_CONTACTS_H_
#define FATHOM_SERVER_WATCH_CONTACTS_H_

#include <atomic>

#include "absl/status/statusor.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "server/change_log.h"
#include "server/marks.h"
#include "server/watch_progress.h"

namespace fathom::server {

// See file comment.
class ContactsWatch {
 public:
  using Response = v1::WatchContactsResponse;

  // The log must be followed (ChangeFeed::Add) before Next, and outlive this.
  ContactsWatch(const v1::WatchContactsRequest& request, const ChangeLog& log)
      : log_(&log),
        batched_(request.batched()),
        progress_({request.from_revision(), request.run_id()}) {}

  // Writes the next message; kIdle: there is none now. Never an error.
  absl::StatusOr<WatchStep> Next(SteadyTime now, const std::atomic<bool>& stop,
                                 Response* out);

 private:
  // Of the contacts that wait, as many as a message may tell. False: none,
  // their names were lost.
  bool WriteContacts(const map::ObstacleMapView& view, SteadyTime now,
                     Response* out);

  const ChangeLog* log_;
  bool batched_;
  // Contacts to be told, by their numbers in the log.
  Marks marks_;
  WatchProgressKeeper progress_;
  // What of the log was read.
  ChangeNumber seen_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WATCH_CONTACTS_H_
