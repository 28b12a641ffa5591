// What can be done with a mission file that no server holds. Each function
// takes the file's lock, so a server that has it open refuses them and they
// refuse a second one. All but CompactMission leave the file as it is.
//
// Errors of all: NOT_FOUND, FAILED_PRECONDITION (in use, no mission, a newer
// one), DATA_LOSS, those of sqlite.h.

#ifndef FATHOM_STORAGE_OFFLINE_H_
#define FATHOM_STORAGE_OFFLINE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "storage/geopackage.h"
#include "storage/mission_records.h"
#include "storage/verify.h"

namespace fathom::storage {

struct MissionInfo {
  MissionMetadata metadata;
  int format_version = 0;
  std::uint64_t file_bytes = 0;
  std::uint64_t wal_bytes = 0;
  std::uint64_t checkpoint_revision = 0;
  std::uint64_t tiles = 0;
  std::uint64_t activities = 0;
  std::uint64_t contacts = 0;
  std::uint64_t history_rows = 0;
  std::uint64_t journal_records = 0;
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
absl::StatusOr<std::uint64_t> CompactMission(const std::string& path);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_OFFLINE_H_
