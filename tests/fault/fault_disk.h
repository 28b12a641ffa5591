// FaultDisk: an SQLite VFS that stands before the real one, writes down every
// change that SQLite asks of the disk, and makes the n-th call fail.
//
// It becomes SQLite's default VFS, so that the code under test runs as it is.
// The real files are written as well: the log serves to rebuild what a power
// cut could have left of them (crash_image.h).
//
// One thread at a time. One object in a process, installed for good.

#ifndef FATHOM_TESTS_FAULT_FAULT_DISK_H_
#define FATHOM_TESTS_FAULT_FAULT_DISK_H_

#include <cstdint>
#include <string>
#include <vector>

namespace fathom::fault {

// One change of one file.
struct DiskOperation {
  enum class Kind { kCreate, kWrite, kTruncate, kSync, kDelete };
  Kind kind = Kind::kWrite;
  std::string file;         // Name without its folder.
  std::int64_t offset = 0;  // kTruncate: the new size.
  std::vector<std::uint8_t> bytes = {};
};

enum class FaultKind {
  kNone,
  // Reads, writes (half done), syncs, truncations, deletions, sizes, opening
  // and the log's shared memory fail with an I/O error.
  kIoError,
  // Writes (half done) and the growth of shared memory find no room.
  kDiskFull,
};

class FaultDisk {
 public:
  // Installs the VFS on the first call.
  static FaultDisk& Get();

  // Writing down what happens; off at first. -shm files are not written down:
  // nothing of them is read after a crash.
  void StartLog();
  void StopLog() { logging_ = false; }
  const std::vector<DiskOperation>& log() const { return log_; }

  // From here on the n-th call (from 1) that `kind` concerns fails: once, or it
  // and all after it.
  void FailAt(FaultKind kind, std::uint64_t n, bool for_good);
  void Heal() { kind_ = FaultKind::kNone; }
  // Whether a call has failed since FailAt.
  bool has_failed() const { return failures_ > 0; }

  // ---- For the VFS. ----
  enum class Call { kOther, kWrite, kGrowSharedMemory };
  // Whether this call must fail.
  bool Fails(Call call);
  void Note(DiskOperation operation);
  bool logging() const { return logging_; }
  bool disk_full() const { return kind_ == FaultKind::kDiskFull; }
  int last_errno() const { return last_errno_; }
  void set_last_errno(int number) { last_errno_ = number; }

 private:
  FaultDisk() = default;

  bool logging_ = false;
  std::vector<DiskOperation> log_;
  FaultKind kind_ = FaultKind::kNone;
  std::uint64_t calls_ = 0;
  std::uint64_t fail_at_ = 0;
  bool for_good_ = false;
  std::uint64_t failures_ = 0;
  int last_errno_ = 0;
};

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_FAULT_DISK_H_
