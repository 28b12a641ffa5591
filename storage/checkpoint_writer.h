// Writes what differs between two views of a map, inside a transaction of the
// caller's, so that the file holds the newer one.

#ifndef FATHOM_STORAGE_CHECKPOINT_WRITER_H_
#define FATHOM_STORAGE_CHECKPOINT_WRITER_H_

#include "absl/status/status.h"
#include "storage/contact_table.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// Writes tiles, activities with their blocks, contacts, the revision; deletes
// the journal segments that end at or before it. Cost: what differs. Memory:
// one blob at a time. REQUIRES: the file holds checkpoint.previous (or that is
// null: then all tables of the checkpoint are emptied first).
absl::Status WriteCheckpoint(const Checkpoint& checkpoint,
                             Connection& connection, ContactTable& contacts);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CHECKPOINT_WRITER_H_
