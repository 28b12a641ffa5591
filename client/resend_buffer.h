// Messages that were numbered and are not yet known to be durable, in order,
// with a mark between those written to the present connection and the rest.
//
//   durable | written ... | not yet written ... | last
//             ^ front       ^ NextToWrite
//
// Invariants: the numbers in the buffer are consecutive; written <= held.
// Cost: O(1) a message. Thread safety: none; the stream's mutex guards it.

#ifndef FATHOM_CLIENT_RESEND_BUFFER_H_
#define FATHOM_CLIENT_RESEND_BUFFER_H_

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

namespace fathom::client {

// `Payload` is the encoded message; copying it should be cheap.
template <typename Payload>
class ResendBuffer {
 public:
  // Holds at most `max_messages` (>= 1) messages of `max_bytes` together; one
  // message alone always fits. The first message gets `first_sequence`.
  ResendBuffer(std::uint64_t first_sequence, std::size_t max_messages,
               std::size_t max_bytes)
      : max_messages_(max_messages),
        max_bytes_(max_bytes),
        last_sequence_(first_sequence - 1),
        durable_sequence_(first_sequence - 1) {}

  // Whether a message of `bytes` may be pushed.
  bool HasRoom(std::size_t bytes) const {
    return messages_.empty() ||
           (messages_.size() < max_messages_ && bytes_ + bytes <= max_bytes_);
  }

  // Appends a message under the next number. REQUIRES: HasRoom(bytes).
  std::uint64_t Push(Payload payload, std::size_t bytes) {
    messages_.push_back({std::move(payload), bytes});
    bytes_ += bytes;
    return ++last_sequence_;
  }

  // Whether a message waits to be written.
  bool HasUnwritten() const { return written_ < messages_.size(); }

  // The next message to write, which counts as written afterwards.
  // REQUIRES: HasUnwritten().
  Payload NextToWrite() { return messages_[written_++].payload; }

  // Counts every message held as not written: a new connection begins.
  void Rewind() { written_ = 0; }

  // Forgets every message up to `sequence`; numbers never pushed and numbers
  // already forgotten change nothing.
  void AckDurable(std::uint64_t sequence) {
    sequence = std::min(sequence, last_sequence_);
    while (durable_sequence_ < sequence) {
      bytes_ -= messages_.front().bytes;
      messages_.pop_front();
      ++durable_sequence_;
      if (written_ > 0) --written_;
    }
  }

  // The last number given; first_sequence - 1 before the first Push.
  std::uint64_t last_sequence() const { return last_sequence_; }
  // Everything up to this number is forgotten.
  std::uint64_t durable_sequence() const { return durable_sequence_; }
  std::size_t size() const { return messages_.size(); }
  std::size_t bytes() const { return bytes_; }

 private:
  struct Message {
    Payload payload;
    std::size_t bytes;
  };

  const std::size_t max_messages_;
  const std::size_t max_bytes_;
  std::deque<Message> messages_;
  std::size_t bytes_ = 0;
  std::size_t written_ = 0;
  std::uint64_t last_sequence_;
  std::uint64_t durable_sequence_;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_RESEND_BUFFER_H_
