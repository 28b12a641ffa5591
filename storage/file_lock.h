// FileLock: at most one process (and one MissionFile in it) works on a mission.
//
// The lock is an flock on a side file, "<mission>.lock", that holds the
// holder's process id in decimal. A side file, because closing any descriptor
// of the mission file itself would drop the POSIX locks that SQLite holds on
// it in the same process. The kernel frees the lock when the process dies,
// however it dies, so a stale side file is harmless; a clean release deletes
// it. flock does not reach over most network file systems: keep missions on a
// local disk.

#ifndef FATHOM_STORAGE_FILE_LOCK_H_
#define FATHOM_STORAGE_FILE_LOCK_H_

#include <string>
#include <utility>

#include "absl/status/statusor.h"

namespace fathom::storage {

// Holds the lock until it is destroyed. Not thread-safe.
class FileLock {
 public:
  // Takes the lock of the file at `path`, which need not exist; never waits.
  //
  // Errors: FAILED_PRECONDITION naming the holder's process id if the lock is
  // held; else the code of what the system refused (PERMISSION_DENIED,
  // NOT_FOUND for a missing folder, ...).
  static absl::StatusOr<FileLock> Acquire(const std::string& path);

  FileLock(FileLock&& other) noexcept
      : lock_path_(std::move(other.lock_path_)),
        descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileLock& operator=(FileLock&& other) noexcept;
  ~FileLock();

 private:
  FileLock(std::string lock_path, int descriptor)
      : lock_path_(std::move(lock_path)), descriptor_(descriptor) {}

  std::string lock_path_;
  int descriptor_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_FILE_LOCK_H_
