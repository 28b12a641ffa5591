#include "map/global/tile.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <utility>

#include "absl/base/macros.h"
#include "absl/strings/str_format.h"
#include "map/global/tile_memory.h"

namespace fathom::map {
namespace {

// Positions of a block, as a power of two.
constexpr unsigned kBlockBits = 6;
// Slots of this level fill a block; deeper ones divide it.
constexpr int kBlockLevel = 3;

// Fields of a divided block's bits.
constexpr unsigned kQuarterShift = 16;
constexpr unsigned kRankShift = 20;

// The bits of a time of three bytes.
constexpr std::uint32_t kShortTimeMask = 0xffffff;

// What an allocator adds to a block of memory, near enough.
constexpr std::size_t kAllocationBytes = 16;

// Bits 0..n of a word. REQUIRES: n < 64.
constexpr std::uint64_t UpTo(unsigned n) {
  return ~std::uint64_t{0} >> (63 - n);
}

// SpreadBits of 0..63: two loads are less than its twenty steps.
constexpr std::array<std::uint16_t, kTileSide> MakeSpread() {
  std::array<std::uint16_t, kTileSide> spread{};
  for (std::uint32_t i = 0; i < kTileSide; ++i) {
    spread[i] = static_cast<std::uint16_t>(SpreadBits(i));
  }
  return spread;
}
constexpr std::array<std::uint16_t, kTileSide> kSpread = MakeSpread();

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

// Where a slot was found.
struct Tile::Rank {
  std::uint32_t slot;
  // Levels below the tile's root if it lies in a divided block, else 0.
  int inner_level;
  // Else: all leaves and divided blocks begin at these bits, and the slot
  // covers this one. Its length is the distance to the next.
  std::uint64_t starts;
  unsigned bit;

  int Level() const {
    if (inner_level != 0) return inner_level;
    // A block begins at bit 0, so there is one at `bit` or before.
    ABSL_ASSERT((starts & UpTo(bit)) != 0);
    const unsigned first =
        63u - static_cast<unsigned>(std::countl_zero(starts & UpTo(bit)));
    // A shift by 64 is undefined, so by `first` and by one.
    const std::uint64_t rest = (starts >> first) >> 1;
    const unsigned length =
        rest == 0 ? 64 - first
                  : 1 + static_cast<unsigned>(std::countr_zero(rest));
    return kBlockLevel - static_cast<int>(std::bit_width(length) - 1) / 2;
  }
};

std::unique_ptr<const Tile> Tile::Build(
    const TileKey& key, std::span<const std::uint8_t> levels,
    std::span<const Leaf> leaves,
    std::vector<std::shared_ptr<const TileSlot>> children, float tolerance_m) {
  // The shape.
  std::uint64_t whole = 0;
  std::uint64_t divided = 0;
  // One more than there can be divided blocks: the rank of the end. It is not
  // needed, and may not fit, if all blocks are divided.
  std::array<std::uint32_t, 65> blocks;
  std::size_t block_count = 0;
  std::uint32_t inner_leaves = 0;
  std::uint32_t position = 0;
  for (const std::uint8_t level : levels) {
    const std::uint32_t block = position >> kBlockBits;
    if (level <= kBlockLevel) {
      whole |= std::uint64_t{1} << block;
    } else {
      if ((position & 63) == 0) {
        divided |= std::uint64_t{1} << block;
        blocks[block_count++] = inner_leaves << kRankShift;
      }
      std::uint32_t& bits = blocks[block_count - 1];
      if (level >= 5) bits |= 1u << (kQuarterShift + ((position >> 4) & 3));
      if (level == 6) bits |= 1u << ((position >> 2) & 15);
      ++inner_leaves;
    }
    position += SpanOf(level);
  }
  blocks[block_count] = inner_leaves << kRankShift;

  const std::size_t slots = levels.size();
  bool residuals = false;
  bool spreads = false;
  std::size_t hazards = 0;
  // Times of known leaves: of the first, and of all that are not 0.
  std::uint32_t first_s = 0;
  bool any_known = false;
  bool times_differ = false;
  std::uint32_t latest_s = 0;
  TileTotals totals;
  for (const Leaf& leaf : leaves) {
    if (leaf.std_code == kChildCode) continue;
    ++totals.leaves;
    if (!leaf.known()) continue;
    ++totals.known_leaves;
    residuals = residuals || leaf.residual_code != 0;
    spreads = spreads || leaf.spread_code != 0;
    hazards += leaf.has_hazard() ? 1 : 0;
    const float residual_m = DecodeResidualM(leaf.residual_code, tolerance_m);
    totals.shoalest_m = std::min(
        totals.shoalest_m, std::min(leaf.depth_m - residual_m, leaf.hazard_m));
    totals.deepest_m = std::max(totals.deepest_m, leaf.depth_m + residual_m);
    if (!any_known) first_s = leaf.time_s;
    any_known = true;
    times_differ = times_differ || leaf.time_s != first_s;
    totals.AddStdAndTime(leaf.std_m(), leaf.time_s);
    latest_s = std::max(latest_s, leaf.time_s);
  }
  const std::uint32_t earliest_s = totals.earliest_s;
  // Charts and quick surveys: one time for all.
  const std::uint32_t time_s = first_s;
  const bool one_time = children.empty() && !times_differ;
  const bool short_time = !one_time && latest_s - earliest_s < kShortTimeMask;
  const std::size_t record_bytes = one_time     ? kTimelessBytes
                                   : short_time ? kShortTimeBytes
                                                : kRecordBytes;
  const std::size_t bytes_behind =
      children.size() * sizeof(Child) + (block_count + 1) * kBlockBytes +
      slots * (record_bytes + (residuals ? 1u : 0u) + (spreads ? 1u : 0u)) +
      hazards * kHazardBytes + 1;
  std::unique_ptr<Tile> tile(new (bytes_behind) Tile(key));
  tile->whole_ = whole;
  tile->divided_ = divided;
  tile->slot_count_ = static_cast<std::uint16_t>(slots);
  tile->record_bytes_ = static_cast<std::uint8_t>(record_bytes);
  tile->time_s_ = one_time ? time_s : short_time ? earliest_s : 0;
  tile->has_residuals_ = residuals;
  tile->has_spreads_ = spreads;
  tile->hazard_count_ = static_cast<std::uint16_t>(hazards);
  tile->blocks_at_ = static_cast<std::uint32_t>(
      sizeof(Tile) + children.size() * sizeof(Child));
  tile->records_at_ = static_cast<std::uint32_t>(
      tile->blocks_at_ + (block_count + 1) * kBlockBytes);

  if (!children.empty()) {
    tile->child_shift_ = static_cast<std::uint8_t>(kMaxLevel - kTileLevels -
                                                   children[0]->key().level);
  }
  std::byte* to = reinterpret_cast<std::byte*>(tile.get() + 1);
  for (Child& child : children) {
    new (to) Child(std::move(child));
    ++tile->child_count_;
    to += sizeof(Child);
  }
  for (std::size_t k = 0; k <= block_count; ++k) {
    StoreAs(to, blocks[k]);
    to += kBlockBytes;
  }
  std::uint32_t child = 0;
  for (const Leaf& leaf : leaves) {
    const bool is_child = leaf.std_code == kChildCode;
    StoreAs(to, is_child ? 0.0f : leaf.depth_m);
    StoreAs(to + 4, leaf.std_code);
    if (!one_time) {
      std::uint32_t field = leaf.time_s;
      if (is_child) {
        field = child++;
      } else if (short_time && leaf.time_s != 0) {
        field = leaf.time_s - earliest_s + 1;
      }
      // Little-endian: of three bytes the least significant.
      std::memcpy(to + 6, &field, record_bytes - 6);
    }
    to += record_bytes;
  }
  // A child's leaf holds what the writer left there.
  if (residuals) {
    for (const Leaf& leaf : leaves) {
      *to++ = std::byte{leaf.known() ? leaf.residual_code : std::uint8_t{0}};
    }
  }
  if (spreads) {
    for (const Leaf& leaf : leaves) {
      *to++ = std::byte{leaf.known() ? leaf.spread_code : std::uint8_t{0}};
    }
  }
  if (hazards > 0) {
    std::byte* depth = to + hazards * sizeof(std::uint16_t);
    for (std::size_t slot = 0; slot < slots; ++slot) {
      if (!leaves[slot].known() || !leaves[slot].has_hazard()) continue;
      StoreAs(to, static_cast<std::uint16_t>(slot));
      StoreAs(depth, leaves[slot].hazard_m);
      to += sizeof(std::uint16_t);
      depth += sizeof(float);
    }
    to = depth;
  }
  *to = std::byte{0};
  tile->totals_ = totals;
  tile->AddChildren();
  return tile;
}

Tile::~Tile() { std::destroy_n(const_cast<Child*>(Children()), child_count_); }

std::uint64_t Tile::memory_bytes() const {
  return blocks_at_ + ByteCount() + 1 + kAllocationBytes;
}

void Tile::AddChildren() {
  TileTotals& totals = totals_;
  totals.tiles = 1;
  totals.memory_bytes = memory_bytes();
  for (const std::shared_ptr<const TileSlot>& child : this->children()) {
    const TileTotals& below = child->totals();
    totals.tiles += below.tiles;
    totals.leaves += below.leaves;
    totals.known_leaves += below.known_leaves;
    totals.memory_bytes += below.memory_bytes;
    totals.shoalest_m = std::min(totals.shoalest_m, below.shoalest_m);
    totals.deepest_m = std::max(totals.deepest_m, below.deepest_m);
    totals.AddStdAndTime(below.largest_std_m, below.earliest_s);
  }
}

inline Tile::Rank Tile::RankOf(std::uint32_t position) const {
  const unsigned block = position >> kBlockBits;
  const std::uint64_t up_to = UpTo(block);
  const unsigned wholes = static_cast<unsigned>(std::popcount(whole_ & up_to));
  const unsigned k = static_cast<unsigned>(std::popcount(divided_ & up_to));
  if ((divided_ >> block) & 1) {
    const auto bits = LoadAs<std::uint32_t>(Block(k - 1));
    const std::uint32_t quarter = (position >> 4) & 3;
    const std::uint32_t patch = (position >> 2) & 15;
    const std::uint32_t in_quarters = (bits >> (kQuarterShift + quarter)) & 1;
    const std::uint32_t in_fours = (bits >> patch) & 1;
    const std::uint32_t before =
        ((1u << patch) - 1) | (((1u << quarter) - 1) << kQuarterShift);
    return {.slot = wholes + (bits >> kRankShift) + quarter +
                    3 * static_cast<unsigned>(std::popcount(bits & before)) +
                    in_quarters * (patch & 3) + in_fours * (position & 3),
            .inner_level =
                kBlockLevel + 1 + static_cast<int>(in_quarters + in_fours),
            .starts = 0,
            .bit = 0};
  }
  const auto bits = LoadAs<std::uint32_t>(Block(k));
  return {.slot = wholes + (bits >> kRankShift) - 1,
          .inner_level = 0,
          .starts = whole_ | divided_,
          .bit = block};
}

int Tile::LevelOf(std::uint32_t position) const {
  return RankOf(position).Level();
}

inline std::uint32_t Tile::TimeOf(const std::byte* record,
                                  std::uint16_t std_code) const {
  if (record_bytes_ == kShortTimeBytes) {
    const std::uint32_t field =
        LoadAs<std::uint32_t>(record + 6) & kShortTimeMask;
    return field == 0 ? 0 : time_s_ + field - 1;
  }
  if (record_bytes_ == kRecordBytes) return LoadAs<std::uint32_t>(record + 6);
  return (std_code >> 14) == 0 ? 0 : time_s_;
}

inline std::uint32_t Tile::ChildIndex(const std::byte* record) const {
  // Below 4096 whether it has three bytes or four.
  return LoadAs<std::uint32_t>(record + 6) & kShortTimeMask;
}

inline void Tile::LoadRest(std::uint32_t slot, Leaf& leaf) const {
  if (has_residuals_) {
    leaf.residual_code = static_cast<std::uint8_t>(Residuals()[slot]);
  }
  if (has_spreads_) {
    leaf.spread_code = static_cast<std::uint8_t>(Spreads()[slot]);
  }
  if (hazard_count_ == 0) [[likely]]
    return;
  const std::byte* const slots = HazardSlots();
  std::uint32_t begin = 0;
  std::uint32_t end = hazard_count_;
  while (begin < end) {
    const std::uint32_t middle = (begin + end) / 2;
    const auto at =
        LoadAs<std::uint16_t>(slots + middle * sizeof(std::uint16_t));
    if (at == slot) {
      leaf.hazard_m = LoadAs<float>(HazardDepths() + middle * sizeof(float));
      return;
    }
    if (at < slot) {
      begin = middle + 1;
    } else {
      end = middle;
    }
  }
}

Tile::Found Tile::Descend(const Tile& root, std::uint32_t row,
                          std::uint32_t col) {
  // Declared here and filled field by field, so that it is built where the
  // caller wants it: a copy would wait for its parts to leave the store buffer
  // (40 ns a query).
  Found found;
  const Tile* tile = &root;
  int shift = kMaxLevel - kTileLevels;
  for (;;) {
    const std::uint32_t position =
        (std::uint32_t{kSpread[(row >> shift) & (kTileSide - 1)]} << 1) |
        kSpread[(col >> shift) & (kTileSide - 1)];
    const Rank rank = tile->RankOf(position);
    const std::byte* const record = tile->Record(rank.slot);
    const auto std_code = LoadAs<std::uint16_t>(record + 4);
    if (std_code != kChildCode) {
      found.leaf.depth_m = LoadAs<float>(record);
      found.leaf.time_s = tile->TimeOf(record, std_code);
      found.leaf.std_code = std_code;
      tile->LoadRest(rank.slot, found.leaf);
      found.level = tile->key_.level + rank.Level();
      return found;
    }
    shift = tile->child_shift_;
    tile = &tile->Children()[tile->ChildIndex(record)]->tile();
  }
}

Tile::Found Tile::Find(std::uint32_t position) const {
  Found found;
  const Rank rank = RankOf(position);
  found.level = rank.Level();
  found.leaf = LeafAt(rank.slot);
  if (IsChild(rank.slot)) {
    found.child = ChildAt(rank.slot).get();
  }
  return found;
}

Leaf Tile::LeafAt(std::uint32_t slot) const {
  const std::byte* const record = Record(slot);
  const auto std_code = LoadAs<std::uint16_t>(record + 4);
  Leaf leaf{.depth_m = LoadAs<float>(record),
            .time_s = std_code == kChildCode ? 0 : TimeOf(record, std_code),
            .std_code = std_code};
  LoadRest(slot, leaf);
  return leaf;
}

bool Tile::IsChild(std::uint32_t slot) const {
  return LoadAs<std::uint16_t>(Record(slot) + 4) == kChildCode;
}

const std::shared_ptr<const TileSlot>& Tile::ChildAt(std::uint32_t slot) const {
  return Children()[ChildIndex(Record(slot))];
}

bool Tile::SameSlots(const Tile& other) const {
  // Children are numbered in Z-order, so that equal places have equal bytes.
  return slot_count_ == other.slot_count_ &&
         child_count_ == other.child_count_ && whole_ == other.whole_ &&
         divided_ == other.divided_ && has_residuals_ == other.has_residuals_ &&
         has_spreads_ == other.has_spreads_ &&
         hazard_count_ == other.hazard_count_ &&
         record_bytes_ == other.record_bytes_ && time_s_ == other.time_s_ &&
         std::memcmp(Block(0), other.Block(0), ByteCount()) == 0;
}

std::unique_ptr<const Tile> Tile::FromContent(
    const TileKey& key, const TileContent& content,
    std::vector<std::shared_ptr<const TileSlot>> children, float tolerance_m) {
  std::vector<Leaf> leaves(content.levels.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    leaves[i].depth_m = content.depths_m[i];
    leaves[i].time_s = content.times_s[i];
    leaves[i].std_code = content.std_codes[i];
  }
  for (std::size_t i = 0; i < content.residual_codes.size(); ++i) {
    leaves[i].residual_code = content.residual_codes[i];
  }
  for (std::size_t i = 0; i < content.spread_codes.size(); ++i) {
    leaves[i].spread_code = content.spread_codes[i];
  }
  for (std::size_t i = 0; i < content.hazard_slots.size(); ++i) {
    leaves[content.hazard_slots[i]].hazard_m = content.hazards_m[i];
  }
  return Build(key, content.levels, leaves, std::move(children), tolerance_m);
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
    content.times_s.push_back(leaf.time_s);
    if (has_residuals_) {
      content.residual_codes.push_back(leaf.residual_code);
    }
    if (has_spreads_) content.spread_codes.push_back(leaf.spread_code);
    if (leaf.has_hazard()) {
      content.hazard_slots.push_back(static_cast<std::uint16_t>(slot));
      content.hazards_m.push_back(leaf.hazard_m);
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
  const TileLadder ladder(max_level);
  const int span = ladder.LevelsOf(key.level);
  if (!ladder.Has(key)) {
    return error(
        absl::StrFormat("no tile of a map of max_level=%d has this "
                        "key",
                        max_level));
  }
  const std::size_t slots = content.levels.size();
  if (slots == 0 || slots > kTileCells || content.depths_m.size() != slots ||
      content.std_codes.size() != slots || content.times_s.size() != slots ||
      (!content.residual_codes.empty() &&
       content.residual_codes.size() != slots) ||
      (!content.spread_codes.empty() && content.spread_codes.size() != slots) ||
      content.hazard_slots.size() != content.hazards_m.size()) {
    return error("the arrays have different lengths");
  }
  std::uint32_t position = 0;
  bool residual_seen = content.residual_codes.empty();
  bool spread_seen = content.spread_codes.empty();
  for (std::size_t i = 0; i < slots; ++i) {
    const int level = content.levels[i];
    if (level > span || position >= kTileCells ||
        position % SpanOf(level) != 0) {
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
    const std::uint8_t spread = content.spread_codes.empty()
                                    ? std::uint8_t{0}
                                    : content.spread_codes[i];
    spread_seen = spread_seen || spread != 0;
    if ((code >> 14) == 0) {
      const bool child = code == kChildCode;
      if ((!child && code != 0) || std::bit_cast<std::uint32_t>(depth_m) != 0 ||
          content.times_s[i] != 0 || residual != 0 || spread != 0 ||
          (child && (level != span || key.level + span >= max_level))) {
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
  if (!spread_seen) return error("spread codes are kept but all zero");
  for (std::size_t i = 0; i < content.hazard_slots.size(); ++i) {
    const std::uint16_t slot = content.hazard_slots[i];
    const float hazard_m = content.hazards_m[i];
    if (slot >= slots || (i > 0 && slot <= content.hazard_slots[i - 1]) ||
        (content.std_codes[slot] >> 14) == 0 ||
        !(hazard_m >= kMinChartDepthM && hazard_m <= kMaxChartDepthM)) {
      return error(absl::StrFormat("hazard %d of %g m at slot %d does not fit",
                                   i, hazard_m, slot));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<RestoredTile> RestoredTile::Make(const TileKey& key,
                                                TileContent content,
                                                int max_level,
                                                float tolerance_m) {
  if (absl::Status status = ValidateContent(key, content, max_level);
      !status.ok()) {
    return status;
  }
  RestoredTile restored{.key = key};
  const bool has_children =
      std::find(content.std_codes.begin(), content.std_codes.end(),
                kChildCode) != content.std_codes.end();
  if (has_children) {
    restored.content = std::move(content);
  } else {
    restored.tile = Tile::FromContent(key, content, {}, tolerance_m);
  }
  return restored;
}

}  // namespace fathom::map
