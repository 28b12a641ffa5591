#include "storage/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom::storage {
namespace {

// A holder that ends deletes the side file; whoever opened it just before
// then locks a file without a name and must try again. More rounds than this
// mean that something else deletes it.
constexpr int kMaxRounds = 100;

std::string ReadHolder(int descriptor) {
  char text[32];
  const ssize_t size = pread(descriptor, text, sizeof(text), 0);
  std::string holder;
  for (ssize_t i = 0; i < size && text[i] >= '0' && text[i] <= '9'; ++i) {
    holder.push_back(text[i]);
  }
  // Empty only in the instant between its flock and its write.
  return holder.empty() ? "unknown" : holder;
}

// Whether the name still leads to the file that was locked.
bool IsCurrent(int descriptor, const std::string& path) {
  struct stat locked = {};
  struct stat named = {};
  return fstat(descriptor, &locked) == 0 && stat(path.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

}  // namespace

absl::StatusOr<FileLock> FileLock::Acquire(const std::string& path) {
  const std::string lock_path = path + ".lock";
  for (int round = 0; round < kMaxRounds; ++round) {
    const int descriptor =
        open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (descriptor < 0) {
      return absl::ErrnoToStatus(errno, absl::StrFormat("open %s", lock_path));
    }
    if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
      const int error = errno;
      const std::string holder = ReadHolder(descriptor);
      close(descriptor);
      if (error == EWOULDBLOCK) {
        return absl::FailedPreconditionError(absl::StrFormat(
            "mission %s is in use by process %s; stop it or choose another "
            "file",
            path, holder));
      }
      return absl::ErrnoToStatus(error, absl::StrFormat("lock %s", lock_path));
    }
    if (!IsCurrent(descriptor, lock_path)) {
      close(descriptor);
      continue;
    }
    const std::string pid = absl::StrFormat("%d\n", getpid());
    if (ftruncate(descriptor, 0) != 0 ||
        pwrite(descriptor, pid.data(), pid.size(), 0) !=
            static_cast<ssize_t>(pid.size())) {
      // The lock holds all the same; only its message to others is poorer. A
      // full disk must not keep a mission from opening.
    }
    return FileLock(lock_path, descriptor);
  }
  return absl::UnavailableError(
      absl::StrFormat("lock file %s keeps vanishing", lock_path));
}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(lock_path_, other.lock_path_);
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

FileLock::~FileLock() {
  if (descriptor_ < 0) return;
  // Deleted while it is held: see kMaxRounds.
  unlink(lock_path_.c_str());
  close(descriptor_);
}

}  // namespace fathom::storage
