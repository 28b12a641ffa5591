#include "map/local/evidence_cells.h"

#include <cmath>

namespace fathom::map {

EvidenceCells::EvidenceCells(const EvidenceCells& other)
    : window_s_(other.window_s_), slots_(other.slots_) {
  fresh_.reserve(RoomFor(other.size()));
  fresh_.assign(other.fresh_.begin(), other.fresh_.end());
  if (!other.any_transferred()) return;
  transferred_.reserve(RoomFor(other.size()));
  transferred_.assign(other.transferred_.begin(), other.transferred_.end());
}

Evidence EvidenceCells::All(std::size_t k) const {
  Evidence all = Fresh(k);
  if (any_transferred()) all.Merge(Transferred(k));
  return all;
}

std::size_t EvidenceCells::CountMeasured() const {
  return static_cast<std::size_t>(
      std::count_if(fresh_.begin(), fresh_.end(), IsMeasured));
}

std::size_t EvidenceCells::CountFresh() const {
  return static_cast<std::size_t>(std::count_if(
      fresh_.begin(), fresh_.end(),
      [](const PackedEvidence& cell) { return CountOf(cell) != 0; }));
}

PackedEvidence EvidenceCells::Pack(const Evidence& evidence, bool measured) {
  const std::uint32_t shoalest = std::isnan(evidence.shoalest_m)
                                     ? kNoShoalest
                                     : PackShoalest(evidence.shoalest_m);
  const std::uint32_t time = PackTime(evidence.time_s);
  return {.weight = evidence.weight,
          .mean_m = evidence.mean_m,
          .scatter = evidence.scatter,
          .shoalest_time = shoalest | time << 24,
          .time_count = time >> 8 | std::uint32_t{evidence.count} << 16 |
                        std::uint32_t{measured} << 31};
}

void EvidenceCells::MarkTransferred() {
  transferred_.reserve(RoomFor(size()));
  transferred_.resize(size());
  for (std::size_t n = 0; n < size(); ++n) {
    if (CountOf(fresh_[n]) == 0) continue;
    Evidence all = Unpack(transferred_[n]);
    all.Merge(Unpack(fresh_[n]));
    transferred_[n] = Pack(all, /*measured=*/true);
    fresh_[n] = Pack(Evidence{}, /*measured=*/true);
  }
}

void EvidenceCells::Restore(std::size_t k, const PackedEvidence& fresh,
                            const PackedEvidence* transferred) {
  Mutable(k) = fresh;
  if (transferred == nullptr) return;
  transferred_.reserve(RoomFor(size()));
  transferred_.resize(size());
  transferred_[slots_[k]] = *transferred;
}

PackedEvidence& EvidenceCells::Touch(std::size_t k) {
  const std::size_t slot = size();
  slots_[k] = static_cast<std::uint8_t>(slot);
  const auto add = [slot](std::vector<PackedEvidence>& cells) {
    if (slot == cells.capacity()) cells.reserve(RoomFor(slot + 1));
    cells.emplace_back();
  };
  if (any_transferred()) add(transferred_);
  add(fresh_);
  return fresh_.back();
}

void EvidenceCells::MoveWindow(std::uint32_t time_s) {
  const std::uint32_t halves =
      static_cast<std::uint32_t>((std::uint64_t{time_s} + 1) / kHalfWindowS);
  const std::uint32_t window_s = (halves == 0 ? 0 : halves - 1) * kHalfWindowS;
  if (window_s <= window_s_) return;
  for (std::vector<PackedEvidence>* cells : {&fresh_, &transferred_}) {
    for (PackedEvidence& cell : *cells) {
      const std::uint32_t was_s = Unpack(cell).time_s;
      if (was_s == 0) continue;
      const std::uint32_t time = 1 + (std::max(was_s, window_s) - window_s);
      cell.shoalest_time = (cell.shoalest_time & kLow24) | time << 24;
      cell.time_count = (cell.time_count & 0xffff'0000u) | time >> 8;
    }
  }
  window_s_ = window_s;
}

bool operator==(const EvidenceCells& a, const EvidenceCells& b) {
  if (a.size() != b.size() || a.window_s_ != b.window_s_ ||
      a.any_transferred() != b.any_transferred()) {
    return false;
  }
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    if (a.touched(k) != b.touched(k)) return false;
    if (!a.touched(k)) continue;
    if (*a.Find(k) != *b.Find(k)) return false;
    if (a.any_transferred() && *a.FindTransferred(k) != *b.FindTransferred(k)) {
      return false;
    }
  }
  return true;
}

}  // namespace fathom::map
