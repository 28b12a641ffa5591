// The kinds of input of the target `requests`: the first byte of an input says
// which message the rest is. The seeds (seeds.cc) use the same numbers.

#ifndef FATHOM_TESTS_FUZZ_REQUESTS_H_
#define FATHOM_TESTS_FUZZ_REQUESTS_H_

#include <cstdint>

namespace fathom::fuzz {

enum class Request : std::uint8_t {
  kPing,
  kContactReport,
  kReportContacts,
  kStartActivity,
  kDropContact,
  kPriorHeader,
  kDepthTile,
  kQueryObstacle,
  kQueryObstacles,
  kCheckTrajectory,
  kFindNearestObstacle,
  kGetRegion,
  kWatchRegion,
  kWatchContacts,
  kWatchTrajectory,
  kCount,
};

// The run_id of the log that the watches read.
inline constexpr std::uint64_t kFuzzRun = 77;

}  // namespace fathom::fuzz

#endif  // FATHOM_TESTS_FUZZ_REQUESTS_H_
