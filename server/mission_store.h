// What the keeper needs of the mission file: one call that makes a batch of
// changes durable. storage::MissionFile is the one in use; tests put a
// faulty one in its place (disk full, I/O error, a slow disk).

#ifndef FATHOM_SERVER_MISSION_STORE_H_
#define FATHOM_SERVER_MISSION_STORE_H_

#include "absl/status/status.h"
#include "storage/mission_file.h"

namespace fathom::server {

// Called by the storage thread only.
class MissionStore {
 public:
  MissionStore() = default;
  MissionStore(const MissionStore&) = delete;
  MissionStore& operator=(const MissionStore&) = delete;
  virtual ~MissionStore() = default;

  // Makes the batch durable as one transaction, or nothing of it. Errors:
  // RESOURCE_EXHAUSTED (no space: may pass by itself, try again); DATA_LOSS
  // (damage stands in the way, nothing was written); any other error means
  // that the file must not be written any more.
  virtual absl::Status Commit(const storage::Batch& batch) = 0;

  // Nothing has come for a while: time for housekeeping that never waits.
  virtual void Idle() {}
};

// The mission file. `file` must outlive it.
class MissionFileStore final : public MissionStore {
 public:
  explicit MissionFileStore(storage::MissionFile& file) : file_(file) {}
  absl::Status Commit(const storage::Batch& batch) override {
    return file_.Commit(batch);
  }
  void Idle() override {
    // A failure shows in the next Commit, which has someone to tell.
    (void)file_.CopyLog();
  }

 private:
  storage::MissionFile& file_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MISSION_STORE_H_
