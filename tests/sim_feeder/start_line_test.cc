#include "sim_feeder/start_line.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace fathom::feeder {
namespace {

TEST(StartPlace, NobodyStartsBeforeAllAreThere) {
  constexpr int kVehicles = 8;
  std::latch line(kVehicles);
  std::atomic<int> there = 0;
  std::atomic<int> started_early = 0;
  std::vector<std::thread> vehicles;
  for (int i = 0; i < kVehicles; ++i) {
    vehicles.emplace_back([&] {
      StartPlace place(line);
      ++there;
      place.WaitForAll();
      if (there != kVehicles) ++started_early;
    });
  }
  for (std::thread& vehicle : vehicles) vehicle.join();
  EXPECT_EQ(started_early, 0);
}

TEST(StartPlace, WhoFailsHoldsUpNobody) {
  std::latch line(2);
  std::thread failed([&] { const StartPlace place(line); });
  StartPlace place(line);
  place.WaitForAll();
  failed.join();
}

}  // namespace
}  // namespace fathom::feeder
