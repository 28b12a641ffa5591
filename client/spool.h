// Numbered messages on disk until the server has them: the journal of a link
// that may be down for hours, on the sender's side.
//
// A folder holds segments "<kind>-<number of the first message>.spool":
//
//   header   "FTHMSPL2", epoch u64, first number u64, source id 64 bytes
//            padded with zeros, CRC-32C of all that u32
//   message  size u32 (> 0), CRC-32C of the bytes u32, the bytes; again and
//            again, and between them after a sync, where it fits
//   mark     2^32 - 1 u32, CRC-32C of the rest u32; how much of the file was
//            synced, bytes u64
//
// all little-endian. "FTHMSPL1" is read too; it has no marks. A message's
// number is its place; the last segment alone grows, and a segment goes when
// the server has all of it. Epoch and numbers outlive the sender: at least one
// segment stays.
//
// What survives: every message that Append took outlives the death of the
// process; a power cut spares the messages up to synced_sequence(). A cut
// message's number is given again: only what was synced may be sent, or the
// server takes the new message for the old one. Append syncs a whole segment,
// Open what it finds.
//
// What a power cut left of unsynced messages is cut off when the spool is
// opened again, from the first that is not whole on: a disk writes them in any
// order. They are in the last segment, and no mark behind them covers them. All
// other damage is refused (DATA_LOSS), never skipped; so is a segment under
// another number than its header's. Without marks, only one message behind
// which there are at most zeros is cut off. A last segment that is a part of a
// header, or zeros of a header's size, goes: its making was cut short.
//
// Bounded: the segments never hold more than max_bytes together, a new one's
// header included; opened with more, they take no message and no mark.
// Cost: one write(2) a message. Thread safety: none.

#ifndef FATHOM_CLIENT_SPOOL_H_
#define FATHOM_CLIENT_SPOOL_H_

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"

namespace fathom::client {

struct SpoolOptions {
  // Made if it is not there.
  std::string folder;
  // A word for file names; one spool of a kind in a folder.
  std::string kind;
  // Whose messages, 1 to 64 characters; must be that of the files that are
  // there. Empty: theirs (NOT_FOUND without any).
  std::string source_id;
  // Of the messages of a new spool, > 0; an old one keeps its own.
  std::uint64_t epoch = 1;
  // Of all segments, >= kLeastSpoolBytes.
  std::uint64_t max_bytes = 256u << 20;
};

// The largest message that the server takes.
inline constexpr std::size_t kMostSpoolMessageBytes = 4u << 20;

// Holds a message of any size, once the server has what came before it.
inline constexpr std::uint64_t kLeastSpoolBytes = 16u << 20;

class Spool {
 public:
  // Errors: INVALID_ARGUMENT (max_bytes; another source's spool),
  // FAILED_PRECONDITION (another process has it open), NOT_FOUND,
  // PERMISSION_DENIED, DATA_LOSS (damaged, naming the file).
  static absl::StatusOr<std::unique_ptr<Spool>> Open(
      const SpoolOptions& options);

  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  const std::string& source_id() const { return source_id_; }
  std::uint64_t epoch() const { return epoch_; }
  // Number of the oldest message that is there; last_sequence() + 1: none is.
  std::uint64_t first_sequence() const { return segments_.front().first; }
  // Number of the newest message ever appended.
  std::uint64_t last_sequence() const { return segments_.back().end() - 1; }
  // Of all segments.
  std::uint64_t bytes() const { return bytes_; }

  // Whether a message of that size may be appended.
  bool HasRoom(std::size_t message_bytes) const;

  // Writes the message under the number last_sequence() + 1. REQUIRES: not
  // empty, at most kMostSpoolMessageBytes. Errors: RESOURCE_EXHAUSTED (no room,
  // or a full disk: nothing was written), DATA_LOSS (the disk failed).
  absl::Status Append(std::string_view message);

  // The next message in order, from first_sequence() on; false: there is none
  // yet. Errors: DATA_LOSS.
  absl::StatusOr<bool> Read(std::string& message);

  // The server has everything up to that number: segments that hold nothing
  // else go. Errors: DATA_LOSS (the disk failed).
  absl::Status Release(std::uint64_t sequence);

  // Leaves an empty segment, so that who opens the spool next finds nothing to
  // send. REQUIRES: everything was released. Errors: as Release.
  absl::Status Clear();

  // Every message up to this number survives a power cut.
  std::uint64_t synced_sequence() const { return synced_; }
  // What was appended survives a power cut from here on. Errors: DATA_LOSS,
  // and from then on always: nobody knows what the disk has.
  absl::Status Sync();
  // The same, for a spool that `mutex` guards: others have it while the disk
  // works. REQUIRES: the spool is not destroyed meanwhile.
  absl::Status SyncUnlocked(Mutex& mutex) FATHOM_REQUIRES(mutex);

 private:
  struct Segment {
    std::string path;
    std::uint64_t first = 0;  // Number of its first message.
    std::uint64_t count = 0;
    std::uint64_t bytes = 0;  // Of the file, header included.
    bool has_marks = true;
    bool is_marked = false;  // A mark at its end covers all before.

    std::uint64_t end() const { return first + count; }
  };

  explicit Spool(const SpoolOptions& options);

  absl::Status Lock();
  absl::Status OpenSegments();
  // Counts the messages of a segment; `segment` ends before the torn end of the
  // last.
  absl::Status Scan(Segment& segment, bool last);
  // Makes an empty segment behind the others the one that grows.
  absl::Status StartSegment(std::uint64_t first);
  // How a sync of `synced`, the last segment as it was then, ended; errno is
  // its error.
  absl::Status NoteSync(const Segment& synced, bool ok);

  const SpoolOptions options_;
  const std::uint64_t segment_bytes_;
  std::string source_id_;
  std::uint64_t epoch_;
  int lock_ = -1;
  // Never empty after Open; numbers follow each other.
  std::deque<Segment> segments_;
  std::uint64_t bytes_ = 0;
  // Of the last segment.
  int append_ = -1;
  std::uint64_t synced_ = 0;
  // A sync failed, or half a message stands at the end.
  absl::Status broken_;
  // The reader's place: in the segment that holds next_read_.
  std::uint64_t next_read_ = 0;
  int read_ = -1;
  std::uint64_t read_first_ = 0;   // The segment that read_ is.
  std::uint64_t read_offset_ = 0;  // Of ahead_'s end in that file.
  // Read from the file and not yet given.
  std::string ahead_;
  std::size_t ahead_used_ = 0;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_SPOOL_H_
