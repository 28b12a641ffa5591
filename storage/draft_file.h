// A database that is made under another name and appears under its own
// complete or not at all: new missions and copies.

#ifndef FATHOM_STORAGE_DRAFT_FILE_H_
#define FATHOM_STORAGE_DRAFT_FILE_H_

#include <string>

#include "absl/status/status.h"

namespace fathom::storage {

// Errors: ALREADY_EXISTS if anything, a dangling link too, is at `path`.
absl::Status CheckAbsent(const std::string& path);

// The name "<target>.new", and what SQLite puts beside it. All is removed when
// this is destroyed, unless it was published; what a crash left behind is
// removed first. REQUIRES: the caller holds the FileLock of `target`.
class DraftFile {
 public:
  explicit DraftFile(const std::string& target);
  DraftFile(const DraftFile&) = delete;
  DraftFile& operator=(const DraftFile&) = delete;
  ~DraftFile();

  // Where to make it.
  const std::string& path() const { return path_; }

  // Gives the finished, synced file its name, durably. Errors: ALREADY_EXISTS;
  // what the system refused.
  absl::Status Publish();

 private:
  void Remove();

  std::string target_;
  std::string path_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_DRAFT_FILE_H_
