// What a power cut can leave of files, from the log of what was asked of the
// disk before it.
//
// A write that was synced is there. Of the others each may be there or not,
// whatever became of those before it, and one may be torn: only a part of its
// bytes arrived. A new name and a deleted one are certain once the file was
// synced or made anew and synced. These are the rules of a disk with a cache
// and of a file system that promises nothing but fsync; ext4 and XFS are
// kinder.

#ifndef FATHOM_TESTS_FAULT_CRASH_IMAGE_H_
#define FATHOM_TESTS_FAULT_CRASH_IMAGE_H_

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/fault/fault_disk.h"

namespace fathom::fault {

using FileBytes = std::vector<std::uint8_t>;
// Name -> content.
using FileSet = std::map<std::string, FileBytes>;

// Which of the unsynced changes arrive.
enum class CrashMode {
  kNothing,     // None of them.
  kEverything,  // All: a crash of the program alone.
  kPrefix,      // Those before one of them.
  kTornPrefix,  // The same, and a part of that one.
  kSome,        // Each with probability 1/2: reordered.
  kTornSome,    // The same, and each that arrives may be torn.
};
inline constexpr int kCrashModes = 6;

class CrashImage {
 public:
  // The disk holds `files`, all synced.
  explicit CrashImage(const FileSet& files);

  void Apply(const DiskOperation& operation);

  // The files after a power cut now.
  FileSet After(CrashMode mode, std::mt19937_64& random) const;

 private:
  struct File {
    // What is certain; nullopt: no such file.
    std::optional<FileBytes> synced;
    std::vector<DiskOperation> unsynced;
  };
  static void ApplyTo(const DiskOperation& operation, std::size_t size,
                      std::optional<FileBytes>& content);

  std::map<std::string, File> files_;
};

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_CRASH_IMAGE_H_
