#include "storage/checkpoint_writer.h"

#include <utility>
#include <vector>

#include "base/status_macros.h"
#include "storage/activity_codec.h"
#include "storage/contact_codec.h"
#include "storage/tile_codec.h"

namespace fathom::storage {
namespace {

using Activities = std::vector<std::shared_ptr<const map::ActivityView>>;

absl::Status WriteTiles(const map::GlobalMapView& before,
                        const map::GlobalMapView& now, Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement replace,
      connection.Prepare(
          "INSERT OR REPLACE INTO tile (tile_key, content) VALUES (?, ?)"));
  FATHOM_ASSIGN_OR_RETURN(
      Statement remove,
      connection.Prepare("DELETE FROM tile WHERE tile_key = ?"));
  absl::Status status;
  map::DiffTiles(before, now,
                 [&](const map::TileKey& key, const map::Tile* tile) {
                   if (!status.ok()) return;
                   if (tile == nullptr) {
                     remove.BindUint(0, key.Packed());
                     status = remove.Run();
                     return;
                   }
                   const Bytes content = EncodeTile(key, tile->Content());
                   replace.BindUint(0, key.Packed());
                   replace.BindBlob(1, content);
                   status = replace.Run();
                 });
  return status;
}

map::StoredActivity ToStored(const map::ActivityView& view) {
  return {.start = {.id = view.id,
                    .vehicle_id = view.vehicle_id,
                    .start = view.start,
                    .options = view.options},
          .open = view.open(),
          .measurements_accepted = view.measurements_accepted,
          .rejects = view.rejects,
          .cells_measured = view.cells_measured};
}

class ActivityWriter {
 public:
  static absl::StatusOr<ActivityWriter> Create(Connection& connection) {
    ActivityWriter writer;
    FATHOM_ASSIGN_OR_RETURN(
        writer.activity_,
        connection.Prepare("INSERT OR REPLACE INTO activity (activity_number, "
                           "activity_id, vehicle_id, start_us, open, content) "
                           "VALUES (?, ?, ?, ?, ?, ?)"));
    FATHOM_ASSIGN_OR_RETURN(
        writer.block_, connection.Prepare("INSERT OR REPLACE INTO local_block "
                                          "(block_key, content) VALUES "
                                          "(?, ?)"));
    FATHOM_ASSIGN_OR_RETURN(
        writer.remove_blocks_,
        connection.Prepare("DELETE FROM local_block WHERE block_key >= ? AND "
                           "block_key < ?"));
    return writer;
  }

  // `before` is null for an activity that the file does not know.
  absl::Status Write(std::uint32_t number, const map::ActivityView* before,
                     const map::ActivityView& now) {
    const Bytes content = EncodeActivity(ToStored(now));
    activity_.BindInt(0, number);
    activity_.BindText(1, now.id.value);
    activity_.BindText(2, now.vehicle_id);
    activity_.BindInt(3, ToUnixMicros(now.start));
    activity_.BindInt(4, now.open() ? 1 : 0);
    activity_.BindBlob(5, content);
    FATHOM_RETURN_IF_ERROR(activity_.Run());
    if (now.open()) return WriteBlocks(number, before, *now.local);
    if (before == nullptr || !before->open()) return absl::OkStatus();
    remove_blocks_.BindUint(0, BlockKey{number, {}}.Packed());
    remove_blocks_.BindUint(1, BlockKey{number + 1, {}}.Packed());
    return remove_blocks_.Run();
  }

 private:
  absl::Status WriteBlocks(std::uint32_t number,
                           const map::ActivityView* before,
                           const map::LocalMapView& now) {
    const map::LocalMapView nothing;
    const bool known = before != nullptr && before->open();
    absl::Status status;
    map::DiffBlocks(known ? *before->local : nothing, now,
                    [&](map::BlockIndex index, const map::LocalBlock& block) {
                      if (!status.ok()) return;
                      const BlockKey key{.activity_number = number,
                                         .index = index};
                      const Bytes content = EncodeBlock(key, block);
                      block_.BindUint(0, key.Packed());
                      block_.BindBlob(1, content);
                      status = block_.Run();
                    });
    return status;
  }

  Statement activity_;
  Statement block_;
  Statement remove_blocks_;
};

absl::Status WriteActivities(const Activities& before, const Activities& now,
                             Connection& connection) {
  if (before == now) return absl::OkStatus();
  FATHOM_ASSIGN_OR_RETURN(ActivityWriter writer,
                          ActivityWriter::Create(connection));
  for (std::size_t i = 0; i < now.size(); ++i) {
    const map::ActivityView* known =
        i < before.size() ? before[i].get() : nullptr;
    // Views are immutable: the same piece is the same content.
    if (known == now[i].get()) continue;
    FATHOM_RETURN_IF_ERROR(
        writer.Write(static_cast<std::uint32_t>(i + 1), known, *now[i]));
  }
  return absl::OkStatus();
}

absl::Status WriteContacts(const map::ContactsView& before,
                           const map::ContactsView& now,
                           ContactTable& contacts) {
  absl::Status status;
  map::DiffContacts(
      before, now,
      [&](const map::Contact& contact) {
        if (!status.ok()) return;
        status = contacts.WriteState(contact.key(),
                                     EncodeContact(contact.ToStored()));
      },
      [&](const map::ContactKey& key) {
        if (status.ok()) status = contacts.ClearState(key);
      });
  return status;
}

absl::Status WriteRejects(const map::RejectCounts& before,
                          const map::RejectCounts& now,
                          Connection& connection) {
  if (before == now) return absl::OkStatus();
  FATHOM_ASSIGN_OR_RETURN(
      Statement replace,
      connection.Prepare("INSERT OR REPLACE INTO contact_reject (reason, "
                         "report_count) VALUES (?, ?)"));
  for (std::size_t i = 1; i < map::kRejectReasonEnd; ++i) {
    const auto reason = static_cast<map::RejectReason>(i);
    if (now.count(reason) == before.count(reason)) continue;
    replace.BindUint(0, i);
    replace.BindUint(1, now.count(reason));
    FATHOM_RETURN_IF_ERROR(replace.Run());
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteCheckpoint(const Checkpoint& checkpoint,
                             Connection& connection, ContactTable& contacts) {
  const map::ObstacleMapView& now = *checkpoint.now;
  const map::ObstacleMapView* const before = checkpoint.previous.get();
  if (before == nullptr) {
    FATHOM_RETURN_IF_ERROR(connection.Execute(
        "DELETE FROM tile; DELETE FROM local_block; DELETE FROM activity; "
        "DELETE FROM contact_reject; "
        "UPDATE contact SET content = NULL WHERE content IS NOT NULL"));
  }
  FATHOM_RETURN_IF_ERROR(
      WriteTiles(before != nullptr ? before->global() : map::GlobalMapView(),
                 now.global(), connection));
  FATHOM_RETURN_IF_ERROR(
      WriteActivities(before != nullptr ? before->activities() : Activities(),
                      now.activities(), connection));
  FATHOM_RETURN_IF_ERROR(WriteContacts(
      before != nullptr ? before->contacts() : map::ContactsView(),
      now.contacts(), contacts));
  FATHOM_RETURN_IF_ERROR(
      WriteRejects(before != nullptr ? before->counters().contact_rejects
                                     : map::RejectCounts(),
                   now.counters().contact_rejects, connection));
  FATHOM_ASSIGN_OR_RETURN(
      Statement trim,
      connection.Prepare("DELETE FROM journal WHERE last_revision <= ?"));
  trim.BindUint(0, now.revision());
  FATHOM_RETURN_IF_ERROR(trim.Run());
  FATHOM_ASSIGN_OR_RETURN(
      Statement mark,
      connection.Prepare("UPDATE mission SET checkpoint_revision = ?, "
                         "checkpoint_as_of_us = ?, degraded_updates = ?"));
  mark.BindUint(0, now.revision());
  mark.BindInt(1, ToUnixMicros(now.as_of()));
  mark.BindUint(2, now.counters().degraded);
  return mark.Run();
}

}  // namespace fathom::storage
