// SourceLedger: which message of which source was taken last, so that each is
// taken exactly once (promise 2 of design.md).
//
// A source numbers its messages from 1 within an epoch, per kind of stream; a
// larger epoch begins at 1 again. Invariant: every number of the newest epoch
// up to `sequence` was taken, refused or reported missing; a number at or
// below it that comes later is a resend and changes nothing.
//
// Not thread-safe: the mapper thread owns it.

#ifndef FATHOM_SERVER_SOURCE_LEDGER_H_
#define FATHOM_SERVER_SOURCE_LEDGER_H_

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include "map/geodesy/ids.h"
#include "storage/mission_records.h"

namespace fathom::server {

// The streams of a source; each is numbered by itself.
using storage::StreamKind;

// A message's number.
struct MessageNumber {
  uint64_t epoch = 0;
  uint64_t sequence = 0;

  friend bool operator==(const MessageNumber&, const MessageNumber&) = default;
};

// What the ledger says of a message.
enum class Verdict {
  kNew,        // Take it; what is missing before it is in the gap.
  kDuplicate,  // Was taken before.
  kOldEpoch,   // Its epoch is behind the newest: cannot be judged, refuse.
  kFull,       // A new source beyond the most that are kept: refuse.
};

// Numbers that never came; none if last < first.
struct MissingNumbers {
  uint64_t first = 1;
  uint64_t last = 0;
  bool any() const { return first <= last; }
};

struct Judgement {
  Verdict verdict = Verdict::kNew;
  MissingNumbers missing = {};
};

// See file comment.
class SourceLedger {
 public:
  // Ten times the vehicles and feeds of the largest fleet we know of; bounds
  // the memory that a hostile client can take.
  static constexpr size_t kMaxSources = 10'000;

  using Key = std::pair<StreamKind, map::SourceId>;
  using Positions = std::map<Key, MessageNumber>;

  // Judges the message and, if it is new, notes it as taken. O(log sources).
  Judgement Take(StreamKind kind, const map::SourceId& source,
                 MessageNumber number);

  // The newest number taken; {0, 0} of a source never heard of.
  MessageNumber Newest(StreamKind kind, const map::SourceId& source) const;

  // Whether the source is known, or there is room for one more.
  bool HasRoomFor(StreamKind kind, const map::SourceId& source) const;

  // Sets a position as stored in the mission file.
  void Restore(StreamKind kind, const map::SourceId& source,
               MessageNumber number);

  // The newest number taken of each source.
  const Positions& positions() const { return positions_; }

 private:
  Positions positions_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_SOURCE_LEDGER_H_
