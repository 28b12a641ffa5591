// The rows of the contact history that reports give: when they are applied,
// and again when the journal is replayed. Pure functions; thread-safe.

#ifndef FATHOM_STORAGE_HISTORY_REPLAY_H_
#define FATHOM_STORAGE_HISTORY_REPLAY_H_

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "map/contacts/contact_map.h"
#include "storage/mission_records.h"

namespace fathom::storage {

// Appends what an outcome adds to the history, under each name that it has
// there. `revision`: the map's after it.
void AppendHistoryRows(map::ContactOutcome outcome, std::uint64_t revision,
                       std::vector<ContactHistoryRow>& rows);

// The rows behind the checkpoint: what the records of the journal gave when
// they were applied, to the bit. Needs the contacts and the journal of
// `loaded` alone. About 5 us a report. Errors: DATA_LOSS if the contacts do not
// fit together, naming one.
absl::StatusOr<std::vector<ContactHistoryRow>> ReplayHistory(
    const Loaded& loaded);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_REPLAY_H_
