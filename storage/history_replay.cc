#include "storage/history_replay.h"

#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/restore.h"

namespace fathom::storage {
namespace {

bool IsOfContact(const JournalRecord& record) {
  return std::holds_alternative<ContactRecord>(record.event) ||
         std::holds_alternative<map::DropContact>(record.event);
}

}  // namespace

void AppendHistoryRows(map::ContactOutcome outcome, std::uint64_t revision,
                       std::vector<ContactHistoryRow>& rows) {
  if (outcome.joint && !outcome.estimates.empty()) {
    for (const map::ContactKey& name : outcome.estimates.front().linked) {
      bool revises = outcome.revised;
      for (map::ContactEstimate estimate : outcome.estimates) {
        std::replace(estimate.linked.begin(), estimate.linked.end(), name,
                     estimate.key);
        estimate.key = name;
        rows.push_back({.revision = revision,
                        .estimate = std::move(estimate),
                        .revises = std::exchange(revises, false)});
      }
    }
  }
  // Of a revision the first row clears the way for all.
  bool revises = outcome.revised;
  for (map::ContactEstimate& estimate : outcome.estimates) {
    rows.push_back({.revision = revision,
                    .estimate = std::move(estimate),
                    .revises = std::exchange(revises, false)});
  }
  for (map::ContactEstimate& estimate : outcome.ended) {
    rows.push_back({.revision = revision, .estimate = std::move(estimate)});
  }
}

absl::StatusOr<std::vector<ContactHistoryRow>> ReplayHistory(
    const Loaded& loaded) {
  std::vector<ContactHistoryRow> rows;
  if (std::none_of(loaded.journal.begin(), loaded.journal.end(), IsOfContact)) {
    return rows;
  }
  const auto options = OptionsOf(loaded.metadata);
  if (!options.ok()) {
    return absl::DataLossError(
        absl::StrFormat("the mission's row: %s", options.status().message()));
  }
  map::ContactMap contacts(options->contacts);
  for (const map::StoredContact& stored : loaded.contacts) {
    const absl::Status restored = contacts.Restore(stored);
    if (!restored.ok()) {
      return absl::DataLossError(
          absl::StrFormat("contact_id=%s does not fit: %s",
                          stored.key.contact.value, restored.message()));
    }
  }
  for (const JournalRecord& record : loaded.journal) {
    if (const auto* report = std::get_if<ContactRecord>(&record.event)) {
      AppendHistoryRows(contacts.Apply(report->report), record.revision, rows);
    } else if (const auto* drop =
                   std::get_if<map::DropContact>(&record.event)) {
      AppendHistoryRows(contacts.Drop(drop->key, drop->time), record.revision,
                        rows);
    }
  }
  return rows;
}

}  // namespace fathom::storage
