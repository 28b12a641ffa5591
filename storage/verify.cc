#include "storage/verify.h"

#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/history_codec.h"
#include "storage/history_features.h"
#include "storage/history_reader.h"
#include "storage/history_replay.h"
#include "storage/history_table.h"
#include "storage/loader.h"
#include "storage/restore.h"

namespace fathom::storage {
namespace {

class Prover {
 public:
  explicit Prover(Connection& connection) : connection_(connection) {}

  absl::StatusOr<Proof> Run() {
    // One moment: what is committed meanwhile is not seen.
    FATHOM_RETURN_IF_ERROR(connection_.Execute("BEGIN"));
    absl::Status status = Prove();
    connection_.Execute("ROLLBACK").IgnoreError();
    FATHOM_RETURN_IF_ERROR(status);
    return std::move(proof_);
  }

 private:
  void Tell(std::string problem) {
    if (proof_.problems.size() < kMaxProblems) {
      proof_.problems.push_back(std::move(problem));
    }
  }
  // A damaged file is a finding; anything else ends the proof.
  absl::Status Note(const absl::Status& status) {
    if (!absl::IsDataLoss(status)) return status;
    Tell(std::string(status.message()));
    return absl::OkStatus();
  }

  absl::Status Prove() {
    FATHOM_RETURN_IF_ERROR(Note(CheckIntegrity()));
    FATHOM_RETURN_IF_ERROR(Note(CheckMap()));
    return Note(CheckHistory());
  }

  absl::Status CheckIntegrity() {
    FATHOM_ASSIGN_OR_RETURN(Statement check,
                            connection_.Prepare(absl::StrFormat(
                                "PRAGMA integrity_check(%d)", kMaxProblems)));
    while (true) {
      FATHOM_ASSIGN_OR_RETURN(const bool more, check.Step());
      if (!more) return absl::OkStatus();
      std::string found = check.ColumnText(0);
      if (found != "ok") Tell("integrity check: " + std::move(found));
    }
  }

  absl::Status CheckMap() {
    FATHOM_ASSIGN_OR_RETURN(Loaded loaded, LoadMission(connection_));
    for (const std::string& damage : loaded.damage) Tell(damage);
    FATHOM_ASSIGN_OR_RETURN(replayed_, ReplayHistory(loaded));
    proof_.revision = loaded.revision;
    proof_.tiles = loaded.tiles.size();
    proof_.journal_records = loaded.journal.size();
    const absl::StatusOr<map::MissionOptions> options =
        OptionsOf(loaded.metadata);
    if (!options.ok()) {
      return absl::DataLossError(
          absl::StrFormat("the mission's row: %s", options.status().message()));
    }
    FATHOM_ASSIGN_OR_RETURN(const RestoredMap restored,
                            RestoreMap(std::move(loaded), *options));
    proof_.digest = restored.map->View()->Digest();
    return absl::OkStatus();
  }

  absl::Status CheckHistory() {
    FATHOM_RETURN_IF_ERROR(ReadWholeHistory(
        connection_, replayed_,
        [this](const ContactHistoryRow&) {
          ++proof_.history_rows;
          return absl::OkStatus();
        },
        [this](const absl::Status& damage) { return Note(damage); }));
    FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                            connection_.QueryInt("PRAGMA user_version"));
    return version < kFirstBlockVersion
               ? absl::OkStatus()
               : CheckBlocks(version >= kFirstFeatureVersion);
  }

  // What the tables say of each block, and their own structure.
  absl::Status CheckBlocks(bool have_features) {
    FATHOM_ASSIGN_OR_RETURN(
        const std::int64_t index_ok,
        connection_.QueryInt(
            "SELECT rtreecheck('contact_history_place') = 'ok'"));
    if (index_ok == 0) Tell("contact_history_place: its tree is damaged");
    FATHOM_ASSIGN_OR_RETURN(
        Statement select,
        connection_.Prepare(
            "SELECT block_id, contact_number, first_time_us, last_time_us, "
            "last_revision, estimate_count, content, contact_number IN "
            "(SELECT contact_number FROM contact) FROM contact_history"));
    FATHOM_ASSIGN_OR_RETURN(HistoryTable table,
                            HistoryTable::Create(connection_));
    HistoryFeatures features(connection_);
    FATHOM_RETURN_IF_ERROR(table.ReloadTotal());
    HistoryTotal total = {.forgotten_estimates =
                              table.total().forgotten_estimates};
    while (true) {
      FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
      if (!more) break;
      const std::string what =
          WhatOfBlock(select.ColumnInt(1), select.ColumnInt(0));
      total.estimates += select.ColumnUint(5);
      total.blocks += 1;
      total.content_bytes += select.ColumnBlob(6).size();
      if (select.ColumnInt(7) == 0) Tell(what + ": its contact is missing");
      const auto rows =
          DecodeHistory(select.ColumnBlob(6), select.ColumnInt(1), what);
      if (!rows.ok()) {
        FATHOM_RETURN_IF_ERROR(Note(rows.status()));
        continue;
      }
      const HistoryBlockMark said = {
          .first = TimeFromUnixMicros(select.ColumnInt(2)),
          .last = TimeFromUnixMicros(select.ColumnInt(3)),
          .last_revision = select.ColumnUint(4),
          .estimates = select.ColumnUint(5)};
      if (MarkOf(*rows) != said) Tell(what + ": its row says otherwise");
      FATHOM_ASSIGN_OR_RETURN(const bool placed,
                              table.IsPlaced(select.ColumnInt(0), *rows));
      if (!placed) Tell(what + ": is not where the index says");
      if (!have_features) continue;
      const auto match =
          features.Match(select.ColumnInt(0), select.ColumnInt(1), *rows);
      if (!match.ok() || !*match) {
        Tell(what + ": tracks or track_points say otherwise");
      }
      if (!match.ok()) FATHOM_RETURN_IF_ERROR(Note(match.status()));
    }
    if (have_features) {
      FATHOM_ASSIGN_OR_RETURN(
          const std::int64_t strangers,
          connection_.QueryInt(
              "SELECT (SELECT count(*) FROM tracks WHERE fid NOT IN (SELECT "
              "block_id FROM contact_history)) + (SELECT count(*) FROM "
              "track_points WHERE fid NOT IN (SELECT block_id FROM "
              "contact_history))"));
      if (strangers != 0) {
        Tell(absl::StrFormat("tracks and track_points have %d rows of no block",
                             strangers));
      }
    }
    if (total != table.total()) {
      Tell("contact_history_total: the blocks hold another number");
    }
    return absl::OkStatus();
  }

  Connection& connection_;
  std::vector<ContactHistoryRow> replayed_;
  Proof proof_;
};

}  // namespace

absl::StatusOr<Proof> ProveMission(Connection& connection) {
  return Prover(connection).Run();
}

}  // namespace fathom::storage
