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
  // Most follow another of the same stream.
  Positions::value_type* last = nullptr;
  const auto raise = [&](StreamKind stream, const map::SourceId& source,
                         Sequence sequence) {
    if (last == nullptr || last->first.first != stream ||
        last->first.second != source) {
      last = &*reached.try_emplace({stream, source}).first;
    }
    last->second = std::max(last->second, sequence);
  };
  for (const JournalRecord& record : batch.journal) {
    if (const auto* ping = std::get_if<PingRecord>(&record.event)) {
      raise(StreamKind::kPings, ping->source, {ping->epoch, ping->sequence});
    } else if (const auto* contact =
                   std::get_if<ContactRecord>(&record.event)) {
      raise(StreamKind::kContacts, contact->report.key.source,
            {contact->epoch, contact->sequence});
    }
  }
  for (const SourcePosition& position : batch.source_positions) {
    raise(position.stream, position.source,
          {position.epoch, position.sequence});
  }
  return reached;
}

}  // namespace fathom::storage
