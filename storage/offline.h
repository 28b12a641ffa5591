// What can be done with a mission file that no server holds. Each function
// takes the file's lock, so a server that has it open refuses them and they
// refuse a second one. CompactMission and ImportMission change a file, the
// others leave it as it is.
//
// Errors of all: NOT_FOUND, FAILED_PRECONDITION (in use, no mission, a newer
// one), DATA_LOSS, those of sqlite.h.

#ifndef FATHOM_STORAGE_OFFLINE_H_
#define FATHOM_STORAGE_OFFLINE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/obstacle_map/obstacle_map.h"
#include "storage/geopackage.h"
#include "storage/migrate.h"
#include "storage/mission_records.h"
#include "storage/verify.h"

namespace fathom::storage {

// What can be counted without reading all of it; what is unset could not be.
struct MissionInfo {
  MissionMetadata metadata;
  int format_version = 0;
  std::uint64_t file_bytes = 0;
  std::uint64_t wal_bytes = 0;
  std::uint64_t checkpoint_revision = 0;
  std::optional<std::uint64_t> tiles;
  std::optional<std::uint64_t> activities;
  std::optional<std::uint64_t> contacts;
  std::optional<std::uint64_t> history_rows;
  std::optional<std::uint64_t> journal_records;
  // Why not all of them are there. ProveFile tells of all damage.
  std::vector<std::string> damage;
};

absl::StatusOr<MissionInfo> ReadInfo(const std::string& path);

// See verify.h.
absl::StatusOr<Proof> ProveFile(const std::string& path);

// See geopackage.h.
absl::StatusOr<ExportedContacts> ExportFile(const std::string& path,
                                            const std::string& out);

// What a repair saved, and what it had to leave.
struct Repair {
  std::vector<std::string> left_out;
  std::uint64_t revision = 0;
  std::string digest;
  std::uint64_t history_rows = 0;
};

// Writes all that can be read of the mission at `path` into a new mission at
// `out`: the map (what cannot be read is unknown in it), positions of sources,
// contact history. Events of the journal behind a damaged segment are left
// out; their sources' positions are kept, so that a resend does not come twice
// into what was saved. Cost: a start's and a checkpoint's.
absl::StatusOr<Repair> RepairMission(const std::string& path,
                                     const std::string& out);

// Rewrites the file without its free pages (a newer format too, if it is old).
// Returns the bytes it takes after. Needs room for a second copy.
absl::StatusOr<std::uint64_t> CompactMission(
    const std::string& path, const MigrationProgress& progress = {});

struct ImportOptions {
  // The variance that a depth gained per second of its age, up to now, before
  // it is used; m^2/s, >= 0. What the answers of the mission that takes it add
  // themselves (its ageing_rate_m2_s) is not added twice. Unset: the rate of
  // the mission that it comes from.
  std::optional<double> ageing_m2_s = std::nullopt;
  Time now{};
  // Its measurements come as a chart, not as evidence.
  bool as_chart = false;
  // Set: `into` is made, with this mission_id and all else of `from`.
  std::optional<std::string> create = std::nullopt;
  // Told where `into` is of an older format.
  MigrationProgress progress = {};
};

struct Import {
  map::MergeResult merge;
  std::uint64_t revision = 0;
  std::string digest;
  // A copy of the mission as it was before; empty for a new one.
  std::string backup;
  // What could not be read of `from`.
  std::vector<std::string> left_out;
};

// Merges the map of the mission at `from` (as if all its activities had been
// completed; without contacts) into that at `into`: map::GlobalMap::MergeMap.
// One transaction behind a proved copy "<into>.r<revision>.bak": a cut leaves
// all or nothing of it. Squares and cells may differ.
//
// Evidence must not count twice: unless it comes as a chart, a mission, or one
// that holds a common third, is taken once.
// Errors: ALREADY_EXISTS (it was, or `into` exists and is to be created),
// FAILED_PRECONDITION (the same mission, another vertical datum),
// INVALID_ARGUMENT (ageing), RESOURCE_EXHAUSTED (max_cells), and those above;
// `into` is then as it was.
absl::StatusOr<Import> ImportMission(const std::string& from,
                                     const std::string& into,
                                     const ImportOptions& options);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_OFFLINE_H_
