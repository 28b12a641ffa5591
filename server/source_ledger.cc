#include "server/source_ledger.h"

namespace fathom::server {

Judgement SourceLedger::Take(StreamKind kind, const map::SourceId& source,
                             MessageNumber number) {
  const Key key(kind, source);
  auto found = positions_.find(key);
  if (found == positions_.end()) {
    if (positions_.size() >= kMaxSources) return {.verdict = Verdict::kFull};
    found = positions_.emplace(key, MessageNumber{number.epoch, 0}).first;
  }
  MessageNumber& position = found->second;
  if (number.epoch < position.epoch) return {.verdict = Verdict::kOldEpoch};
  if (number.epoch > position.epoch) position = {number.epoch, 0};
  if (number.sequence <= position.sequence) {
    return {.verdict = Verdict::kDuplicate};
  }
  const Judgement judgement = {
      .verdict = Verdict::kNew,
      .missing = {position.sequence + 1, number.sequence - 1}};
  position.sequence = number.sequence;
  return judgement;
}

MessageNumber SourceLedger::Newest(StreamKind kind,
                                   const map::SourceId& source) const {
  const auto found = positions_.find(Key(kind, source));
  return found == positions_.end() ? MessageNumber{} : found->second;
}

bool SourceLedger::HasRoomFor(StreamKind kind,
                              const map::SourceId& source) const {
  return positions_.size() < kMaxSources ||
         positions_.contains(Key(kind, source));
}

void SourceLedger::Restore(StreamKind kind, const map::SourceId& source,
                           MessageNumber number) {
  positions_[Key(kind, source)] = number;
}

}  // namespace fathom::server
