#include "tests/fault/file_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstdarg>
#include <optional>
#include <utility>

namespace fathom::fault {
namespace {

FileLog* current = nullptr;

std::string PathOf(int file) {
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  std::array<char, 4096> path;
  const ssize_t size = ::readlink(link.c_str(), path.data(), path.size());
  return {path.data(), size < 0 ? 0 : static_cast<std::size_t>(size)};
}

// Of a path in the folder; nullopt: it is elsewhere.
std::optional<std::string> NameIn(const std::string& folder,
                                  const std::string& path) {
  const std::string start = folder + "/";
  if (!path.starts_with(start)) return std::nullopt;
  return path.substr(start.size());
}

}  // namespace

FileLog::FileLog(std::string folder, bool never_sync)
    : folder_(std::move(folder)), never_sync_(never_sync) {
  current = this;
}

FileLog::~FileLog() { current = nullptr; }

FileLog* FileLog::Current() { return current; }

void FileLog::Note(DiskOperation::Kind kind, const std::string& name,
                   std::int64_t offset, std::vector<std::uint8_t> bytes) {
  operations_.push_back({.kind = kind,
                         .file = name,
                         .offset = offset,
                         .bytes = std::move(bytes)});
}

void FileLog::Created(const std::string& path) {
  const auto name = NameIn(folder_, path);
  if (!name.has_value()) return;
  Note(DiskOperation::Kind::kCreate, *name);
  made_.insert(*name);
  removed_.erase(*name);
}

void FileLog::Wrote(int file, std::int64_t at, const void* bytes,
                    std::size_t size) {
  const auto name = NameIn(folder_, PathOf(file));
  if (!name.has_value()) return;
  const auto* const first = static_cast<const std::uint8_t*>(bytes);
  Note(DiskOperation::Kind::kWrite, *name, at, {first, first + size});
}

void FileLog::Truncated(int file, std::int64_t size) {
  const auto name = NameIn(folder_, PathOf(file));
  if (name.has_value()) Note(DiskOperation::Kind::kTruncate, *name, size);
}

void FileLog::Removed(const std::string& path) {
  const auto name = NameIn(folder_, path);
  if (!name.has_value()) return;
  Note(DiskOperation::Kind::kDelete, *name);
  made_.erase(*name);
  made_and_synced_.erase(*name);
  removed_.insert(*name);
}

void FileLog::Synced(int file) {
  if (never_sync_) return;
  const std::string path = PathOf(file);
  if (path == folder_) {
    for (std::set<std::string>* names : {&made_and_synced_, &removed_}) {
      for (const std::string& name : *names) {
        Note(DiskOperation::Kind::kSync, name);
      }
      names->clear();
    }
    return;
  }
  const auto name = NameIn(folder_, path);
  if (!name.has_value()) return;
  if (made_.erase(*name) > 0) made_and_synced_.insert(*name);
  if (made_and_synced_.count(*name) == 0) {
    Note(DiskOperation::Kind::kSync, *name);
  }
}

}  // namespace fathom::fault

// ---- Before the C library's. ----

extern "C" {

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & O_CREAT) != 0) {
    std::va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  fathom::fault::FileLog* const log = fathom::fault::FileLog::Current();
  const bool creates =
      log != nullptr && (flags & O_CREAT) != 0 && ::access(path, F_OK) != 0;
  const auto file =
      static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
  if (creates && file >= 0) log->Created(path);
  return file;
}

ssize_t write(int file, const void* bytes, std::size_t size) {
  fathom::fault::FileLog* const log = fathom::fault::FileLog::Current();
  struct stat before = {};
  if (log != nullptr) ::fstat(file, &before);
  const ssize_t written = ::syscall(SYS_write, file, bytes, size);
  if (log != nullptr && written > 0) {
    log->Wrote(file, before.st_size, bytes, static_cast<std::size_t>(written));
  }
  return written;
}

int ftruncate(int file, off_t size) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_ftruncate, file, size));
  fathom::fault::FileLog* const log = fathom::fault::FileLog::Current();
  if (log != nullptr && result == 0) log->Truncated(file, size);
  return result;
}

int unlink(const char* path) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_unlink, path));
  fathom::fault::FileLog* const log = fathom::fault::FileLog::Current();
  if (log != nullptr && result == 0) log->Removed(path);
  return result;
}

// The files are for this process alone: nothing need reach the disk.
int fsync(int file) {
  fathom::fault::FileLog* const log = fathom::fault::FileLog::Current();
  if (log != nullptr) log->Synced(file);
  return 0;
}

int fdatasync(int file) { return fsync(file); }

}  // extern "C"
