// Proves a mission: SQLite's integrity check, every blob's checksum, the
// whole contact history, and that the pieces make one map.

#ifndef FATHOM_STORAGE_VERIFY_H_
#define FATHOM_STORAGE_VERIFY_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// Problems that are told, at most; one bad page can cause thousands.
inline constexpr std::size_t kMaxProblems = 100;

// What a proof found.
struct Proof {
  // For people, in the order found; empty: everything held.
  std::vector<std::string> problems;
  // The map that the mission gives; tiles in quarantine are unknown in it.
  // Empty if there is none to be had.
  std::string digest;
  std::uint64_t revision = 0;
  std::uint64_t tiles = 0;
  std::uint64_t journal_records = 0;
  std::uint64_t history_rows = 0;
};

// Reads everything, as of one moment; changes nothing. A read-only connection
// will do. Cost: that of a start, and about 1 us for a row of history; memory:
// another map. Errors: of the connection alone (sqlite.h, but DATA_LOSS: that
// is a problem).
absl::StatusOr<Proof> ProveMission(Connection& connection);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_VERIFY_H_
