// A clock that a test sets and advances; it never moves by itself, so a test
// of ages or timeouts neither sleeps nor depends on the machine. Thread-safe.

#ifndef FATHOM_TESTS_TESTING_FAKE_CLOCK_H_
#define FATHOM_TESTS_TESTING_FAKE_CLOCK_H_

#include <atomic>
#include <cstdint>

#include "base/clock.h"
#include "base/time.h"

namespace fathom::testing {

class FakeClock final : public Clock {
 public:
  // Starts at 2002-05-24T00:00:00Z, a round moment that is not zero:
  // `date -ud 2002-05-24 +%s` is 1022198400.
  static constexpr Time kStart = TimeFromUnixMicros(1'022'198'400'000'000);

  explicit FakeClock(Time start = kStart) : now_us_(ToUnixMicros(start)) {}

  Time Now() const override { return TimeFromUnixMicros(now_us_.load()); }

  // Moves the clock by `span`; a negative one steps it back.
  void Advance(Duration span) { now_us_.fetch_add(span.count()); }

  void Set(Time now) { now_us_.store(ToUnixMicros(now)); }

 private:
  std::atomic<std::int64_t> now_us_;
};

}  // namespace fathom::testing

#endif  // FATHOM_TESTS_TESTING_FAKE_CLOCK_H_
