#include "storage/loader.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/activity_codec.h"
#include "storage/contact_codec.h"
#include "storage/journal_codec.h"
#include "storage/quarantine.h"
#include "storage/restore.h"
#include "storage/schema.h"
#include "storage/tile_codec.h"

namespace fathom::storage {
namespace {

// Blobs that are read before they are decoded: bounds memory.
constexpr std::size_t kTileChunkBytes = std::size_t{64} << 20;

// Threads that decode tiles, at most: a start should be quick, not greedy.
constexpr unsigned kMaxDecoders = 4;

struct TileRow {
  map::TileKey key;
  Bytes blob;
};

// How the tiles are to be made.
struct TilePlan {
  map::MissionOptions map;
  // What those without children may take; beyond it they stay packed.
  std::uint64_t unpacked_bytes;
  // What those that were made take.
  std::atomic<std::uint64_t> taken{0};
};

absl::StatusOr<map::RestoredTile> RestoreRow(TileRow& row, TilePlan& plan) {
  FATHOM_ASSIGN_OR_RETURN(map::TileContent content,
                          DecodeTile(row.key, row.blob));
  FATHOM_ASSIGN_OR_RETURN(
      map::RestoredTile tile,
      map::RestoredTile::Make(row.key, std::move(content),
                              plan.map.global.root.max_level(),
                              static_cast<float>(plan.map.global.tolerance_m)));
  if (tile.tile == nullptr || tile.key.level == 0) return tile;
  const std::uint64_t bytes = tile.tile->memory_bytes();
  if (plan.taken.fetch_add(bytes) + bytes > plan.unpacked_bytes) {
    plan.taken -= bytes;
    tile.Pack(std::move(row.blob));
  }
  return tile;
}

// Tiles as they come: the sound ones, and which are not.
struct TileHarvest {
  std::vector<map::RestoredTile> sound;
  std::set<map::TileKey> damaged;
  std::vector<std::string> damage;

  // Keeps why the tile is damaged; an error that is not the tile's own (a
  // newer version, the disk) is returned.
  absl::Status Quarantine(const map::TileKey& key, const absl::Status& why) {
    if (!absl::IsDataLoss(why)) return why;
    damaged.insert(key);
    damage.push_back(std::string(why.message()));
    return absl::OkStatus();
  }
};

// Decodes, checks and builds the tiles of `rows` on several threads, in the
// order of the rows.
absl::Status RestoreRows(std::vector<TileRow>& rows, TilePlan& plan,
                         TileHarvest& harvest) {
  std::vector<absl::StatusOr<map::RestoredTile>> tiles(rows.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < rows.size(); i = next++) {
      tiles[i] = RestoreRow(rows[i], plan);
    }
  };
  const unsigned threads = std::clamp(std::thread::hardware_concurrency(), 1u,
                                      rows.size() < 64 ? 1u : kMaxDecoders);
  std::vector<std::thread> helpers;
  for (unsigned i = 1; i < threads; ++i) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  harvest.sound.reserve(harvest.sound.size() + tiles.size());
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (tiles[i].ok()) {
      harvest.sound.push_back(*std::move(tiles[i]));
    } else {
      FATHOM_RETURN_IF_ERROR(
          harvest.Quarantine(rows[i].key, tiles[i].status()));
    }
  }
  return absl::OkStatus();
}

// The key of the first tile behind `last`, without touching its content.
absl::StatusOr<std::optional<std::int64_t>> NextTileKey(Connection& connection,
                                                        std::int64_t last) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT tile_key FROM tile WHERE tile_key > ? ORDER "
                         "BY tile_key LIMIT 1"));
  select.BindInt(0, last);
  FATHOM_ASSIGN_OR_RETURN(const bool found, select.Step());
  if (!found) return std::nullopt;
  return select.ColumnInt(0);
}

// Of inner pages that were changed: they lead back to rows before.
absl::Status TilesOutOfOrder() {
  return absl::DataLossError("they are not in the order of their keys");
}

// The tiles behind a page that cannot be read, from the last one backwards as
// far as they can be. Behind `last`, in the order of their keys.
absl::Status ReadFromTheEnd(Connection& connection, std::int64_t last,
                            std::vector<TileRow>& rows) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT tile_key, content FROM tile WHERE tile_key > "
                         "? ORDER BY tile_key DESC"));
  select.BindInt(0, last);
  const std::size_t before = rows.size();
  std::int64_t above = std::numeric_limits<std::int64_t>::max();
  while (true) {
    const absl::StatusOr<bool> more = select.Step();
    if (!more.ok() && !absl::IsDataLoss(more.status())) return more.status();
    if (!more.ok() || !*more) break;
    const std::int64_t key = select.ColumnInt(0);
    if (key <= last || key >= above) break;
    above = key;
    const ByteSpan blob = select.ColumnBlob(1);
    rows.push_back(
        {.key = map::TileKey::FromPacked(static_cast<std::uint64_t>(key)),
         .blob = Bytes(blob.begin(), blob.end())});
  }
  std::reverse(rows.begin() + static_cast<std::ptrdiff_t>(before), rows.end());
  return absl::OkStatus();
}

// Reads on behind `last` until the end or `kTileChunkBytes`; false at the end.
// A tile that cannot be read is put into quarantine and stepped over; of those
// in a page that cannot be read not even the keys are known: MendTree finds
// what is missing.
absl::StatusOr<bool> ReadTileRows(Connection& connection, std::int64_t& last,
                                  std::vector<TileRow>& rows,
                                  TileHarvest& harvest) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT tile_key, content FROM tile WHERE tile_key > "
                         "? ORDER BY tile_key"));
  select.BindInt(0, last);
  const auto read_from_the_end =
      [&](const absl::Status& why) -> absl::StatusOr<bool> {
    harvest.damage.push_back(absl::StrFormat(
        "tiles behind tile_key=%d cannot be read: %s", last, why.message()));
    FATHOM_RETURN_IF_ERROR(ReadFromTheEnd(connection, last, rows));
    return false;
  };
  std::size_t bytes = 0;
  while (bytes < kTileChunkBytes) {
    const absl::StatusOr<bool> more = select.Step();
    if (!more.ok()) {
      if (!absl::IsDataLoss(more.status())) return more.status();
      const auto key = NextTileKey(connection, last);
      if (!key.ok() || !key->has_value()) {
        return read_from_the_end(more.status());
      }
      if (**key <= last) return read_from_the_end(TilesOutOfOrder());
      const auto tile =
          map::TileKey::FromPacked(static_cast<std::uint64_t>(**key));
      FATHOM_RETURN_IF_ERROR(harvest.Quarantine(
          tile, absl::DataLossError(absl::StrFormat("%s: %s", TileName(tile),
                                                    more.status().message()))));
      last = **key;
      return true;
    }
    if (!*more) return false;
    const std::int64_t key = select.ColumnInt(0);
    if (key <= last) return read_from_the_end(TilesOutOfOrder());
    last = key;
    const auto tile = map::TileKey::FromPacked(static_cast<std::uint64_t>(key));
    const ByteSpan blob = select.ColumnBlob(1);
    rows.push_back({.key = tile, .blob = Bytes(blob.begin(), blob.end())});
    bytes += blob.size();
  }
  return true;
}

absl::Status LoadTiles(Connection& connection,
                       std::uint64_t unpacked_tile_bytes, Loaded& loaded) {
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions map,
                          OptionsOf(loaded.metadata));
  TilePlan plan{.map = map, .unpacked_bytes = unpacked_tile_bytes};
  TileHarvest harvest;
  std::int64_t last = -1;
  bool more = true;
  while (more) {
    std::vector<TileRow> rows;
    FATHOM_ASSIGN_OR_RETURN(more,
                            ReadTileRows(connection, last, rows, harvest));
    FATHOM_RETURN_IF_ERROR(RestoreRows(rows, plan, harvest));
  }
  FATHOM_RETURN_IF_ERROR(
      MendTree(map.global, harvest.damaged, harvest.sound, harvest.damage));
  loaded.tiles = std::move(harvest.sound);
  loaded.damage = std::move(harvest.damage);
  return absl::OkStatus();
}

absl::Status LoadBlocks(Connection& connection, std::uint32_t number,
                        LoadedActivity& activity) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT block_key, content FROM local_block WHERE "
                         "block_key >= ? AND block_key < ? ORDER BY "
                         "block_key"));
  select.BindUint(0, BlockKey{number, {}}.Packed());
  select.BindUint(1, BlockKey{number + 1, {}}.Packed());
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    const BlockKey key = BlockKey::FromPacked(select.ColumnUint(0));
    FATHOM_ASSIGN_OR_RETURN(map::LocalBlock block,
                            DecodeBlock(key, select.ColumnBlob(1)));
    activity.blocks.emplace_back(key.index, std::move(block));
  }
}

absl::Status LoadActivities(Connection& connection, Loaded& loaded) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT activity_number, activity_id, content FROM "
                         "activity ORDER BY activity_number"));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    const std::int64_t number = select.ColumnInt(0);
    const std::string id = select.ColumnText(1);
    const std::string what = absl::StrFormat("activity_id=%s", id);
    LoadedActivity activity;
    FATHOM_ASSIGN_OR_RETURN(activity.activity,
                            DecodeActivity(select.ColumnBlob(2), what));
    if (activity.activity.start.id.value != id) {
      return absl::DataLossError(what + ": holds another activity");
    }
    if (activity.activity.open) {
      FATHOM_RETURN_IF_ERROR(
          LoadBlocks(connection, static_cast<std::uint32_t>(number), activity));
    }
    loaded.activities.push_back(std::move(activity));
  }
}

absl::Status LoadContacts(Connection& connection, Loaded& loaded) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT source_id, contact_id, content FROM contact "
                         "WHERE content IS NOT NULL ORDER BY source_id, "
                         "contact_id"));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    const map::ContactKey key{.source = {select.ColumnText(0)},
                              .contact = {select.ColumnText(1)}};
    const std::string what =
        absl::StrFormat("contact source_id=%s contact_id=%s", key.source.value,
                        key.contact.value);
    FATHOM_ASSIGN_OR_RETURN(map::StoredContact contact,
                            DecodeContact(select.ColumnBlob(2), what));
    if (contact.key != key) {
      return absl::DataLossError(what + ": holds another contact");
    }
    loaded.contacts.push_back(std::move(contact));
  }
}

absl::Status LoadCheckpointMark(Connection& connection, Loaded& loaded) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT checkpoint_revision, checkpoint_as_of_us, "
                         "degraded_updates FROM mission"));
  FATHOM_ASSIGN_OR_RETURN(const bool row, select.Step());
  if (!row) return absl::DataLossError("the mission table is empty");
  loaded.checkpoint_revision = select.ColumnUint(0);
  loaded.checkpoint_as_of = TimeFromUnixMicros(select.ColumnInt(1));
  loaded.counters.degraded = select.ColumnUint(2);
  FATHOM_ASSIGN_OR_RETURN(
      Statement rejects,
      connection.Prepare("SELECT reason, report_count FROM contact_reject"));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, rejects.Step());
    if (!more) return absl::OkStatus();
    const std::uint64_t reason = rejects.ColumnUint(0);
    if (reason == 0 || reason >= map::kRejectReasonEnd) {
      return absl::DataLossError(absl::StrFormat(
          "contact_reject: reason %d is none of this version's", reason));
    }
    loaded.counters.contact_rejects.Add(static_cast<map::RejectReason>(reason),
                                        rejects.ColumnUint(1));
  }
}

absl::Status LoadJournal(Connection& connection, Loaded& loaded) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT segment_id, record_count, content FROM "
                         "journal ORDER BY segment_id"));
  loaded.revision = loaded.checkpoint_revision;
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    const std::string what =
        absl::StrFormat("journal segment_id=%d", select.ColumnInt(0));
    std::vector<JournalRecord> records;
    FATHOM_RETURN_IF_ERROR(DecodeJournal(select.ColumnBlob(2), what, records));
    if (records.size() != select.ColumnUint(1)) {
      return absl::DataLossError(
          absl::StrFormat("%s: %d records, its row says %d", what,
                          records.size(), select.ColumnUint(1)));
    }
    for (JournalRecord& record : records) {
      // A segment may reach back behind the checkpoint.
      if (record.revision <= loaded.checkpoint_revision) continue;
      if (record.revision < loaded.revision) {
        return absl::DataLossError(
            absl::StrFormat("%s: revision %d comes after %d", what,
                            record.revision, loaded.revision));
      }
      loaded.revision = record.revision;
      loaded.journal.push_back(std::move(record));
    }
  }
}

}  // namespace

absl::StatusOr<std::vector<SourcePosition>> LoadSourcePositions(
    Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT stream, source_id, epoch, sequence FROM "
                         "source_position ORDER BY stream, source_id"));
  std::vector<SourcePosition> positions;
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return positions;
    positions.push_back({.stream = static_cast<StreamKind>(select.ColumnInt(0)),
                         .source = {select.ColumnText(1)},
                         .epoch = select.ColumnUint(2),
                         .sequence = select.ColumnUint(3)});
  }
}

absl::StatusOr<Loaded> LoadMission(Connection& connection,
                                   std::uint64_t unpacked_tile_bytes) {
  Loaded loaded;
  FATHOM_ASSIGN_OR_RETURN(loaded.metadata, ReadMetadata(connection));
  FATHOM_RETURN_IF_ERROR(LoadCheckpointMark(connection, loaded));
  FATHOM_RETURN_IF_ERROR(LoadTiles(connection, unpacked_tile_bytes, loaded));
  FATHOM_RETURN_IF_ERROR(LoadActivities(connection, loaded));
  FATHOM_RETURN_IF_ERROR(LoadContacts(connection, loaded));
  FATHOM_ASSIGN_OR_RETURN(loaded.source_positions,
                          LoadSourcePositions(connection));
  FATHOM_RETURN_IF_ERROR(LoadJournal(connection, loaded));
  return loaded;
}

absl::StatusOr<Loaded> LoadContactsAndJournal(Connection& connection) {
  Loaded loaded;
  FATHOM_ASSIGN_OR_RETURN(loaded.metadata, ReadMetadata(connection));
  FATHOM_RETURN_IF_ERROR(LoadCheckpointMark(connection, loaded));
  FATHOM_RETURN_IF_ERROR(LoadContacts(connection, loaded));
  FATHOM_RETURN_IF_ERROR(LoadJournal(connection, loaded));
  return loaded;
}

absl::StatusOr<Loaded> SalvageMission(Connection& connection) {
  Loaded loaded;
  FATHOM_ASSIGN_OR_RETURN(loaded.metadata, ReadMetadata(connection));
  FATHOM_RETURN_IF_ERROR(LoadCheckpointMark(connection, loaded));
  loaded.revision = loaded.checkpoint_revision;
  // A step keeps what it had read before it met the damage.
  const auto note = [&loaded](const absl::Status& status) {
    if (!absl::IsDataLoss(status)) return status;
    loaded.damage.push_back(std::string(status.message()));
    return absl::OkStatus();
  };
  FATHOM_RETURN_IF_ERROR(
      note(LoadTiles(connection, map::TileMemoryOptions::kUnlimited, loaded)));
  FATHOM_RETURN_IF_ERROR(note(LoadActivities(connection, loaded)));
  FATHOM_RETURN_IF_ERROR(note(LoadContacts(connection, loaded)));
  auto positions = LoadSourcePositions(connection);
  FATHOM_RETURN_IF_ERROR(note(positions.status()));
  if (positions.ok()) loaded.source_positions = *std::move(positions);
  FATHOM_RETURN_IF_ERROR(note(LoadJournal(connection, loaded)));
  return loaded;
}

}  // namespace fathom::storage
