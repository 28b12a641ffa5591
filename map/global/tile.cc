#include "map/global/tile.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/str_format.h"

namespace fathom::map {
namespace {

// Positions of a block of `words`, as a power of two.
constexpr unsigned kBlockBits = 6;
// Slots of this level fill a block; deeper ones divide it.
constexpr int kBlockLevel = 3;

// What an allocator adds to a block of memory, near enough.
constexpr std::size_t kAllocationBytes = 16;

// Bits 0..n of a word. REQUIRES: n < 64.
constexpr std::uint64_t UpTo(unsigned n) {
  return ~std::uint64_t{0} >> (63 - n);
}

// The level of the slot that covers bit `n` of `starts`, whose bits stand for
// the cells `finest` levels down: a slot's length is the distance between its
// own bit and the next.
inline int LevelAt(std::uint64_t starts, unsigned n, int finest) {
  const unsigned first =
      63u - static_cast<unsigned>(std::countl_zero(starts & UpTo(n)));
  // A shift by 64 is undefined, so by `first` and by one.
  const std::uint64_t rest = (starts >> first) >> 1;
  const unsigned length =
      rest == 0 ? 64 - first
                : 1 + static_cast<unsigned>(std::countr_zero(rest));
  return finest - static_cast<int>(std::bit_width(length) - 1) / 2;
}

template <typename T>
T LoadAs(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

template <typename T>
void StoreAs(std::byte* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

}  // namespace

std::shared_ptr<const Tile> Tile::Build(
    const TileKey& key, std::span<const std::uint8_t> levels,
    std::span<const Leaf> leaves,
    std::vector<std::shared_ptr<const Tile>> children, float tolerance_m) {
  std::shared_ptr<Tile> tile(new Tile(key));
  tile->slot_count_ = static_cast<std::uint32_t>(levels.size());
  tile->children_ = std::move(children);
  tile->children_.shrink_to_fit();

  // The shape.
  std::array<std::uint64_t, 64> words;
  std::array<std::uint16_t, 65> ranks;
  std::size_t word_count = 0;
  ranks[0] = 0;
  std::uint32_t position = 0;
  for (const std::uint8_t level : levels) {
    const std::uint32_t block = position >> kBlockBits;
    if (level <= kBlockLevel) {
      tile->whole_ |= std::uint64_t{1} << block;
    } else {
      if ((position & 63) == 0) {
        tile->divided_ |= std::uint64_t{1} << block;
        words[word_count] = 0;
        ranks[word_count + 1] = ranks[word_count];
        ++word_count;
      }
      words[word_count - 1] |= std::uint64_t{1} << (position & 63);
      ++ranks[word_count];
    }
    position += SpanOf(level);
  }

  // The one block of memory.
  const std::size_t slots = levels.size();
  const bool residuals =
      std::any_of(leaves.begin(), leaves.end(),
                  [](const Leaf& leaf) { return leaf.residual_code != 0; });
  const std::size_t ranks_at = word_count * sizeof(std::uint64_t);
  const std::size_t records_at =
      ranks_at + (word_count + 1) * sizeof(std::uint16_t);
  const std::size_t residuals_at = records_at + slots * kRecordBytes;
  tile->byte_count_ = residuals_at + (residuals ? slots : 0);
  tile->bytes_ = std::make_unique<std::byte[]>(tile->byte_count_);
  std::byte* const bytes = tile->bytes_.get();
  std::memcpy(bytes, words.data(), ranks_at);
  std::memcpy(bytes + ranks_at, ranks.data(), records_at - ranks_at);
  tile->words_ = bytes;
  tile->ranks_ = bytes + ranks_at;
  tile->records_ = bytes + records_at;
  tile->residuals_ = residuals ? bytes + residuals_at : nullptr;

  std::uint32_t child = 0;
  for (std::size_t i = 0; i < slots; ++i) {
    std::byte* const record = bytes + records_at + i * kRecordBytes;
    const Leaf& leaf = leaves[i];
    if (leaf.std_code == kChildCode) {
      StoreAs<std::uint32_t>(record + 4, child++);
    } else {
      StoreAs(record, leaf.depth_m);
      StoreAs(record + 4, leaf.time_s);
      if (residuals) {
        bytes[residuals_at + i] = std::byte{leaf.residual_code};
      }
    }
    StoreAs(record + 8, leaf.std_code);
  }
  tile->AddTotals(tolerance_m);
  return tile;
}

void Tile::AddTotals(float tolerance_m) {
  TileTotals& totals = totals_;
  totals.tiles = 1;
  totals.memory_bytes = sizeof(Tile) + byte_count_ +
                        children_.size() * sizeof(std::shared_ptr<const Tile>) +
                        // This, its reference count, its bytes, its children.
                        4 * kAllocationBytes;
  for (std::uint32_t slot = 0; slot < slot_count_; ++slot) {
    if (IsChild(slot)) continue;
    const Leaf leaf = LeafAt(slot);
    ++totals.leaves;
    if (!leaf.known()) continue;
    ++totals.known_leaves;
    const float residual_m = DecodeResidualM(leaf.residual_code, tolerance_m);
    totals.shoalest_m = std::min(totals.shoalest_m, leaf.depth_m - residual_m);
    totals.deepest_m = std::max(totals.deepest_m, leaf.depth_m + residual_m);
  }
  for (const std::shared_ptr<const Tile>& child : children_) {
    const TileTotals& below = child->totals();
    totals.tiles += below.tiles;
    totals.leaves += below.leaves;
    totals.known_leaves += below.known_leaves;
    totals.memory_bytes += below.memory_bytes;
    totals.shoalest_m = std::min(totals.shoalest_m, below.shoalest_m);
    totals.deepest_m = std::max(totals.deepest_m, below.deepest_m);
  }
}

std::uint32_t Tile::IndexOf(std::uint32_t position, int* level) const {
  const unsigned block = position >> kBlockBits;
  const std::uint64_t up_to = UpTo(block);
  const unsigned wholes = static_cast<unsigned>(std::popcount(whole_ & up_to));
  if ((divided_ >> block) & 1) {
    const unsigned k =
        static_cast<unsigned>(std::popcount(divided_ & up_to)) - 1;
    const std::uint64_t word = LoadAs<std::uint64_t>(words_ + 8 * k);
    const unsigned inner = position & 63;
    *level = LevelAt(word, inner, kTileLevels);
    return wholes + LoadAs<std::uint16_t>(ranks_ + 2 * k) +
           static_cast<unsigned>(std::popcount(word & UpTo(inner))) - 1;
  }
  const unsigned k = static_cast<unsigned>(std::popcount(divided_ & up_to));
  *level = LevelAt(whole_ | divided_, block, kBlockLevel);
  return wholes + LoadAs<std::uint16_t>(ranks_ + 2 * k) - 1;
}

Tile::Found Tile::Find(std::uint32_t position) const {
  Found found;
  const std::uint32_t slot = IndexOf(position, &found.level);
  found.leaf = LeafAt(slot);
  if (found.leaf.std_code == kChildCode) {
    found.child = children_[found.leaf.time_s].get();
  }
  return found;
}

Leaf Tile::LeafAt(std::uint32_t slot) const {
  const std::byte* const record = Record(slot);
  return {.depth_m = LoadAs<float>(record),
          .time_s = LoadAs<std::uint32_t>(record + 4),
          .std_code = LoadAs<std::uint16_t>(record + 8),
          .residual_code = residuals_ == nullptr
                               ? std::uint8_t{0}
                               : static_cast<std::uint8_t>(residuals_[slot])};
}

bool Tile::IsChild(std::uint32_t slot) const {
  return LoadAs<std::uint16_t>(Record(slot) + 8) == kChildCode;
}

const std::shared_ptr<const Tile>& Tile::ChildAt(std::uint32_t slot) const {
  return children_[LoadAs<std::uint32_t>(Record(slot) + 4)];
}

bool Tile::SameSlots(const Tile& other) const {
  // Children are numbered in Z-order, so that equal places have equal bytes.
  return slot_count_ == other.slot_count_ && whole_ == other.whole_ &&
         divided_ == other.divided_ && byte_count_ == other.byte_count_ &&
         std::memcmp(bytes_.get(), other.bytes_.get(), byte_count_) == 0;
}

TileContent Tile::Content() const {
  TileContent content;
  content.levels.reserve(slot_count_);
  content.depths_m.reserve(slot_count_);
  content.std_codes.reserve(slot_count_);
  content.times_s.reserve(slot_count_);
  ForEachSlot([&](std::uint32_t, std::uint32_t slot, int level) {
    const Leaf leaf = LeafAt(slot);
    content.levels.push_back(static_cast<std::uint8_t>(level));
    content.depths_m.push_back(leaf.depth_m);
    content.std_codes.push_back(leaf.std_code);
    content.times_s.push_back(leaf.std_code == kChildCode ? 0 : leaf.time_s);
    if (residuals_ != nullptr) {
      content.residual_codes.push_back(leaf.residual_code);
    }
  });
  return content;
}

absl::Status ValidateContent(const TileKey& key, const TileContent& content,
                             int max_level) {
  const auto error = [&key](const std::string& what) {
    return absl::DataLossError(absl::StrFormat(
        "tile level=%d row=%d col=%d: %s", key.level, key.row, key.col, what));
  };
  if (!key.IsValid() || (key.level > 0 && key.level >= max_level)) {
    return error(
        absl::StrFormat("no tile of a map of max_level=%d has this "
                        "key",
                        max_level));
  }
  const std::size_t slots = content.levels.size();
  if (slots == 0 || slots > kTileCells || content.depths_m.size() != slots ||
      content.std_codes.size() != slots || content.times_s.size() != slots ||
      (!content.residual_codes.empty() &&
       content.residual_codes.size() != slots)) {
    return error("the arrays have different lengths");
  }
  std::uint32_t position = 0;
  bool residual_seen = content.residual_codes.empty();
  for (std::size_t i = 0; i < slots; ++i) {
    const int level = content.levels[i];
    if (level > kTileLevels || key.level + level > max_level ||
        position >= kTileCells || position % SpanOf(level) != 0) {
      return error(
          absl::StrFormat("slot %d of level %d does not fit", i, level));
    }
    position += SpanOf(level);
    const std::uint16_t code = content.std_codes[i];
    const float depth_m = content.depths_m[i];
    const std::uint8_t residual = content.residual_codes.empty()
                                      ? std::uint8_t{0}
                                      : content.residual_codes[i];
    residual_seen = residual_seen || residual != 0;
    if ((code >> 14) == 0) {
      const bool child = code == kChildCode;
      if ((!child && code != 0) || std::bit_cast<std::uint32_t>(depth_m) != 0 ||
          content.times_s[i] != 0 || residual != 0 ||
          (child &&
           (level != kTileLevels || key.level + kTileLevels >= max_level))) {
        return error(
            absl::StrFormat("slot %d without a leaf is not canonical", i));
      }
    } else if ((code & 0x3fff) > kMaxStdBits ||
               !(depth_m >= kMinChartDepthM && depth_m <= kMaxChartDepthM)) {
      return error(absl::StrFormat("slot %d holds depth_m=%g std_code=%d", i,
                                   depth_m, code));
    }
  }
  if (position != kTileCells) return error("the slots do not fill the tile");
  if (!residual_seen) return error("residual codes are kept but all zero");
  return absl::OkStatus();
}

}  // namespace fathom::map
