// The contact history for GDAL and QGIS: two layers in the mission file, of
// GeoPackage's tables (gpkg_tables.h), that say of each block of
// contact_history, with the block's id as `fid`:
//   tracks        a line, every estimate of the block a vertex; NULL where the
//                 block has one alone
//   track_points  a point, the block's last estimate, with its motion
// docs/storage_format.md says what each column means. Written and deleted with
// the block, in its transaction: they are never of another moment.
//
// Cost: 22 bytes of the file an estimate (16 a vertex) and 0.3 us; a point for
// every estimate would be ten times as much: `fathom mission export` writes
// those.
//
// One thread at a time; inside the caller's transaction.

#ifndef FATHOM_STORAGE_HISTORY_FEATURES_H_
#define FATHOM_STORAGE_HISTORY_FEATURES_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// What a block's two rows take, beside 16 bytes an estimate, where source and
// contact have names of some 8 letters: times and names as text, the point.
inline constexpr std::uint64_t kFeatureBlockBytes = 220;
inline constexpr std::uint64_t kVertexBytes = 16;

// The first format that has these tables.
inline constexpr int kFirstFeatureVersion = 8;

// Makes the tables, empty.
absl::Status CreateFeatureTables(Connection& connection);

// Fills the tables, new and empty, from all blocks; `done` is called for each
// with its estimates. Errors: those of sqlite.h; a block that cannot be read is
// left out.
absl::Status FillFeatureTables(
    Connection& connection,
    const std::function<void(std::uint64_t estimates)>& done);

class HistoryFeatures {
 public:
  // `connection` must outlive it. A file without the tables will do as long as
  // nothing is asked of this.
  explicit HistoryFeatures(Connection& connection) : connection_(&connection) {}

  // REQUIRES: rows, a block's; positions, theirs.
  absl::Status Insert(std::int64_t block_id, std::int64_t contact_number,
                      std::span<const ContactHistoryRow> rows,
                      std::span<const map::GeodeticPoint> positions);
  absl::Status Delete(std::int64_t block_id);

  // Whether the tables say of the block what Insert would write.
  absl::StatusOr<bool> Match(std::int64_t block_id, std::int64_t contact_number,
                             std::span<const ContactHistoryRow> rows);

 private:
  // Prepared when first needed.
  absl::Status Prepare(std::optional<Statement>& statement, const char* sql);

  Connection* connection_;
  std::optional<Statement> insert_track_;
  std::optional<Statement> insert_point_;
  std::optional<Statement> delete_track_;
  std::optional<Statement> delete_point_;
  std::optional<Statement> match_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_FEATURES_H_
