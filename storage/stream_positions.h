// How far each stream of each source has come: what a batch reaches, beside
// what the file holds (the table `source_position`).

#ifndef FATHOM_STORAGE_STREAM_POSITIONS_H_
#define FATHOM_STORAGE_STREAM_POSITIONS_H_

#include <cstdint>
#include <map>
#include <utility>

#include "map/geodesy/ids.h"
#include "storage/mission_records.h"

namespace fathom::storage {

using StreamKey = std::pair<StreamKind, map::SourceId>;
using Sequence = std::pair<std::uint64_t, std::uint64_t>;  // Epoch first.
using Positions = std::map<StreamKey, Sequence>;

// Positions only grow: a resend in a batch does not take one back.
void Raise(Positions& positions, StreamKind stream, const map::SourceId& source,
           Sequence sequence);

// The positions that a batch reaches.
Positions PositionsReached(const Batch& batch);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_STREAM_POSITIONS_H_
