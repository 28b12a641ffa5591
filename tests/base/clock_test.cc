#include "base/clock.h"

#include <gtest/gtest.h>

#include <chrono>

#include "tests/testing/fake_clock.h"

namespace fathom {
namespace {

TEST(SystemClock, TellsTheMachinesTime) {
  const SystemClock clock;
  const auto before =
      std::chrono::floor<Duration>(std::chrono::system_clock::now());
  const Time now = clock.Now();
  const auto after = std::chrono::system_clock::now();
  EXPECT_GE(now, before);
  EXPECT_LE(now, after);
}

TEST(FakeClock, StandsStillUntilItIsMoved) {
  testing::FakeClock clock;
  EXPECT_EQ(FormatTime(clock.Now()), "2002-05-24T00:00:00Z");
  EXPECT_EQ(clock.Now(), clock.Now());
  clock.Advance(std::chrono::milliseconds(1500));
  EXPECT_EQ(FormatTime(clock.Now()), "2002-05-24T00:00:01.500Z");
  clock.Set(TimeFromUnixMicros(0));
  EXPECT_EQ(FormatTime(clock.Now()), "1970-01-01T00:00:00Z");
}

}  // namespace
}  // namespace fathom
