// What both ingest streams are opened with and what they report back.
// Plain values.

#ifndef FATHOM_CLIENT_INGEST_PROGRESS_H_
#define FATHOM_CLIENT_INGEST_PROGRESS_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "fathom/v1/types.pb.h"

namespace fathom::client {

struct IngestStreamOptions {
  // Who sends: 1-64 characters of [A-Za-z0-9._-]. One stream of a kind per
  // source at a time.
  std::string source_id = {};

  // The numbering epoch, or 0: the wall clock's microseconds when the stream
  // is opened, which is larger than any epoch opened before. A caller that
  // keeps its own count across restarts states both epoch and first_sequence.
  std::uint64_t epoch = 0;

  // Number of the first message, >= 1.
  std::uint64_t first_sequence = 1;

  // Messages that may be on the way: sent and not yet durable. Send waits
  // when there are that many. 8192 pings of 101 beams are 14 MB and 0.1 s of
  // work at 80 k pings/s, well above the server's group commit of 2-20 ms.
  std::size_t max_in_flight = 8192;

  // Their size together, bytes.
  std::size_t max_in_flight_bytes = 32u << 20;

  // How long one call (Send, Flush, WaitApplied, Finish) may go without the
  // server making anything more durable or applied, before it returns
  // DEADLINE_EXCEEDED (or, after a cut, the error of the cut). Covers waiting
  // for room, for acks and for a server that is away.
  std::chrono::milliseconds patience{30'000};

  // After a cut: connect again and resend from durable_sequence + 1 inside
  // the call that notices. False: that call returns the cut's error, and the
  // caller decides when to Reconnect.
  bool resume = true;
};

// At most this many of the newest rejections, and of the newest gaps, are
// kept; the counts go on.
inline constexpr std::size_t kMaxRemembered = 1000;

// State of a stream; counters run since it was opened, over all connections,
// as told by the acks that arrived.
struct IngestProgress {
  // The numbering epoch in use.
  std::uint64_t epoch = 0;
  // Number of the last message taken by Send; first_sequence - 1: none yet.
  std::uint64_t sent_sequence = 0;
  // Every message up to this one is visible to queries (or was rejected).
  std::uint64_t applied_sequence = 0;
  // Every message up to this one survives a power cut.
  std::uint64_t durable_sequence = 0;
  // Revision of the map that holds applied_sequence: give it as min_revision
  // to read what was sent.
  std::uint64_t map_revision = 0;
  // Pings or reports applied.
  std::uint64_t messages_applied = 0;
  // Pings or reports that the server had applied before (resends).
  std::uint64_t messages_duplicate = 0;
  // Measurements (beams) fused; 0 for contacts.
  std::uint64_t measurements_accepted = 0;
  // Measurements and messages refused, by reason; ordered by reason.
  std::vector<v1::RejectCount> rejects;
  // Messages refused whole, oldest first, at most kMaxRemembered.
  std::vector<v1::Rejection> rejections;
  // Numbers that the server missed, oldest first, at most kMaxRemembered.
  std::vector<v1::SequenceGap> gaps;
  // Connections made after the first.
  std::uint64_t reconnects = 0;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_INGEST_PROGRESS_H_
