#include "tests/fault/expected_state.h"

#include <algorithm>
#include <variant>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/restore.h"

namespace fathom::fault {
namespace {

void Raise(ExpectedState& state, storage::StreamKind stream,
           const std::string& source, std::uint64_t epoch,
           std::uint64_t sequence) {
  auto& held = state.positions[{static_cast<int>(stream), source}];
  held = std::max(held, {epoch, sequence});
}

}  // namespace

ExpectedState ExpectedState::OfNew(map::ObstacleMap& map) {
  return {.revision = map.revision(),
          .digest = map.View()->Digest(),
          .positions = {},
          .history = {}};
}

void ExpectedState::Add(const storage::Batch& batch, map::ObstacleMap& map) {
  revision = map.revision();
  digest = map.View()->Digest();
  for (const storage::JournalRecord& record : batch.journal) {
    if (const auto* ping = std::get_if<storage::PingRecord>(&record.event)) {
      Raise(*this, storage::StreamKind::kPings, ping->source.value, ping->epoch,
            ping->sequence);
    } else if (const auto* contact =
                   std::get_if<storage::ContactRecord>(&record.event)) {
      Raise(*this, storage::StreamKind::kContacts,
            contact->report.key.source.value, contact->epoch,
            contact->sequence);
    }
  }
  for (const storage::SourcePosition& position : batch.source_positions) {
    Raise(*this, position.stream, position.source.value, position.epoch,
          position.sequence);
  }
  for (const storage::ContactHistoryRow& row : batch.contact_history) {
    history[row.estimate.key.contact.value].push_back(row.revision);
  }
}

absl::StatusOr<ExpectedState> StateOf(storage::MissionFile& file) {
  FATHOM_ASSIGN_OR_RETURN(storage::Loaded loaded, file.Load());
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions options,
                          storage::OptionsOf(loaded.metadata));
  ExpectedState state;
  for (const storage::SourcePosition& position : loaded.source_positions) {
    Raise(state, position.stream, position.source.value, position.epoch,
          position.sequence);
  }
  FATHOM_ASSIGN_OR_RETURN(const storage::RestoredMap restored,
                          storage::RestoreMap(std::move(loaded), options));
  state.revision = restored.map->revision();
  state.digest = restored.map->View()->Digest();
  // The script's contacts; one that was never reported is not found.
  for (const char* contact : {"even", "odd"}) {
    std::vector<std::uint64_t> revisions;
    const absl::Status read = file.ReadContactHistory(
        {.source = {"c4i"}, .contact = {contact}}, Time::min(), Time::max(),
        [&](const storage::ContactHistoryRow& row) {
          revisions.push_back(row.revision);
          return true;
        });
    if (absl::IsNotFound(read)) continue;
    FATHOM_RETURN_IF_ERROR(read);
    state.history[contact] = std::move(revisions);
  }
  return state;
}

absl::StatusOr<ExpectedState> FoundState(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(const auto file, storage::MissionFile::Open(path));
  FATHOM_ASSIGN_OR_RETURN(ExpectedState state, StateOf(*file));
  FATHOM_RETURN_IF_ERROR(file->Close());
  return state;
}

std::string Difference(const ExpectedState& wanted,
                       const ExpectedState& found) {
  if (found.revision != wanted.revision) {
    return absl::StrFormat("revision %d, not %d", found.revision,
                           wanted.revision);
  }
  if (found.digest != wanted.digest) {
    return absl::StrFormat("revision %d has digest %s, not %s", found.revision,
                           found.digest, wanted.digest);
  }
  if (found.positions != wanted.positions) return "other source positions";
  if (found.history != wanted.history) return "another contact history";
  return "";
}

}  // namespace fathom::fault
