#include "storage/stream_positions.h"

#include <algorithm>
#include <variant>

namespace fathom::storage {

void Raise(Positions& positions, StreamKind stream, const map::SourceId& source,
           Sequence sequence) {
  Sequence& held = positions[{stream, source}];
  held = std::max(held, sequence);
}

Positions PositionsReached(const Batch& batch) {
  Positions reached;
  for (const JournalRecord& record : batch.journal) {
    if (const auto* ping = std::get_if<PingRecord>(&record.event)) {
      Raise(reached, StreamKind::kPings, ping->source,
            {ping->epoch, ping->sequence});
    } else if (const auto* contact =
                   std::get_if<ContactRecord>(&record.event)) {
      Raise(reached, StreamKind::kContacts, contact->report.key.source,
            {contact->epoch, contact->sequence});
    }
  }
  for (const SourcePosition& position : batch.source_positions) {
    Raise(reached, position.stream, position.source,
          {position.epoch, position.sequence});
  }
  return reached;
}

}  // namespace fathom::storage
