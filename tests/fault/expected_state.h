// What a mission must hold: the oracle of the fault tests, led along beside
// the file and compared with what a restart finds.

#ifndef FATHOM_TESTS_FAULT_EXPECTED_STATE_H_
#define FATHOM_TESTS_FAULT_EXPECTED_STATE_H_

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "map/obstacle_map/obstacle_map.h"
#include "storage/mission_file.h"

namespace fathom::fault {

struct ExpectedState {
  std::uint64_t revision = 0;
  std::string digest;
  // (stream, source) -> newest (epoch, sequence).
  std::map<std::pair<int, std::string>, std::pair<std::uint64_t, std::uint64_t>>
      positions;
  // Contact -> revisions of its history, as they are read.
  std::map<std::string, std::vector<std::uint64_t>> history;

  static ExpectedState OfNew(map::ObstacleMap& map);
  // The batch was committed and `map` is as of it.
  void Add(const storage::Batch& batch, map::ObstacleMap& map);
};

// Opens the mission as a restart does, reads all of it, closes it.
absl::StatusOr<ExpectedState> FoundState(const std::string& path);

// The same of an open one, before its first commit.
absl::StatusOr<ExpectedState> StateOf(storage::MissionFile& file);

// What differs, for people; empty: nothing.
std::string Difference(const ExpectedState& wanted, const ExpectedState& found);

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_EXPECTED_STATE_H_
