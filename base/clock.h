// Where "now" comes from. The map never asks (its callers pass a Time in);
// the server, the client and the feeder ask a Clock, so that a test can decide.
//
// The second implementation is tests/testing/fake_clock.h.

#ifndef FATHOM_BASE_CLOCK_H_
#define FATHOM_BASE_CLOCK_H_

#include "base/time.h"

namespace fathom {

// A source of the current moment. Implementations are thread-safe.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  // The current moment, UTC. It may step backwards (an operator or NTP sets
  // the clock): never subtract two of these to measure a span, use
  // std::chrono::steady_clock.
  virtual Time Now() const = 0;
};

// The machine's wall clock. Costs near 30 ns.
class SystemClock final : public Clock {
 public:
  Time Now() const override;
};

}  // namespace fathom

#endif  // FATHOM_BASE_CLOCK_H_
