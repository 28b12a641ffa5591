// FileLog: what a program asks of the disk for the files of one folder, by the
// C library's calls: open, write, ftruncate, unlink, fsync, fdatasync. This
// program's own stand before the library's.
//
// The log is what a power cut is computed from (crash_image.h), which knows no
// folders: a file that was made counts as synced when it and then its folder
// were, one that was removed when the folder was.
//
// One thread at a time, one object at a time. Files are written at their end.

#ifndef FATHOM_TESTS_FAULT_FILE_LOG_H_
#define FATHOM_TESTS_FAULT_FILE_LOG_H_

#include <set>
#include <string>
#include <vector>

#include "tests/fault/fault_disk.h"

namespace fathom::fault {

class FileLog {
 public:
  // `never_sync`: the disk lies; the negative control.
  FileLog(std::string folder, bool never_sync);
  ~FileLog();
  FileLog(const FileLog&) = delete;
  FileLog& operator=(const FileLog&) = delete;

  const std::vector<DiskOperation>& operations() const { return operations_; }

  // ---- For the calls; a path outside the folder is ignored. ----
  static FileLog* Current();
  void Created(const std::string& path);
  void Wrote(int file, std::int64_t at, const void* bytes, std::size_t size);
  void Truncated(int file, std::int64_t size);
  void Removed(const std::string& path);
  void Synced(int file);

 private:
  void Note(DiskOperation::Kind kind, const std::string& name,
            std::int64_t offset = 0, std::vector<std::uint8_t> bytes = {});

  const std::string folder_;
  const bool never_sync_;
  std::vector<DiskOperation> operations_;
  // Made, and not yet in a synced folder: those that were synced themselves,
  // those that were not.
  std::set<std::string> made_and_synced_;
  std::set<std::string> made_;
  std::set<std::string> removed_;
};

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_FILE_LOG_H_
