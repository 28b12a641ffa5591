#include "storage/draft_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::storage {
namespace {

namespace fs = std::filesystem;

// A new name is durable when its folder is.
absl::Status SyncFolderOf(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  const int descriptor = open(folder.empty() ? "." : folder.c_str(),
                              O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) {
    return absl::ErrnoToStatus(errno, absl::StrFormat("open %s", folder));
  }
  const int result = fsync(descriptor);
  const int error = errno;
  close(descriptor);
  if (result == 0) return absl::OkStatus();
  return absl::ErrnoToStatus(error, absl::StrFormat("fsync %s", folder));
}

}  // namespace

absl::Status CheckAbsent(const std::string& path) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(path, error))) return absl::OkStatus();
  return absl::AlreadyExistsError(
      absl::StrFormat("%s exists; choose another name", path));
}

DraftFile::DraftFile(const std::string& target)
    : target_(target), path_(target + ".new") {
  Remove();
}

DraftFile::~DraftFile() { Remove(); }

absl::Status DraftFile::Publish() {
  FATHOM_RETURN_IF_ERROR(CheckAbsent(target_));
  std::error_code error;
  fs::rename(path_, target_, error);
  if (error) {
    return absl::ErrnoToStatus(error.value(),
                               absl::StrFormat("rename %s", path_));
  }
  return SyncFolderOf(target_);
}

void DraftFile::Remove() {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
    fs::remove(path_ + suffix, ignored);
  }
}

}  // namespace fathom::storage
