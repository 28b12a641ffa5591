#include "storage/verify.h"

#include <string_view>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_codec.h"
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
    FATHOM_ASSIGN_OR_RETURN(
        Statement select,
        connection_.Prepare(
            "SELECT contact_number, time_us, content, contact_number IN "
            "(SELECT contact_number FROM contact) FROM contact_history"));
    while (true) {
      FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
      if (!more) return absl::OkStatus();
      ++proof_.history_rows;
      const std::string what =
          absl::StrFormat("contact_history contact_number=%d time_us=%d",
                          select.ColumnInt(0), select.ColumnInt(1));
      const absl::StatusOr<map::ContactEstimate> point =
          DecodeContactEstimate(select.ColumnBlob(2), what);
      if (!point.ok()) {
        FATHOM_RETURN_IF_ERROR(Note(point.status()));
      } else if (ToUnixMicros(point->time) != select.ColumnInt(1)) {
        Tell(what + ": holds another time");
      }
      if (select.ColumnInt(3) == 0) Tell(what + ": its contact is missing");
    }
  }

  Connection& connection_;
  Proof proof_;
};

}  // namespace

absl::StatusOr<Proof> ProveMission(Connection& connection) {
  return Prover(connection).Run();
}

}  // namespace fathom::storage
