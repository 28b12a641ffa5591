// The copy-on-write tree under a local map: directory -> superblock of 16 x 16
// pointers -> block.
//
// Every piece is marked with the writer's epoch in which it was made. The
// writer raises its epoch with each view it hands out, so a piece of the
// present epoch belongs to the writer alone and may be changed; an older one
// may be in a view and is copied first. A writer never changes a piece that a
// view can see: that is the whole of the thread safety, no counter and no
// lock takes part in it.
//
// Costs for 25 M cells (313 x 313 blocks): the directory is 400 pointers
// (6.4 kB) and is copied at most once per view, a superblock (4 kB) and a
// block (at most 5.6 kB) at most once per view in which it changes.

#ifndef FATHOM_MAP_LOCAL_BLOCK_DIRECTORY_H_
#define FATHOM_MAP_LOCAL_BLOCK_DIRECTORY_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "map/local/local_block.h"

namespace fathom::map {

struct BlockNode {
  std::uint64_t epoch = 0;  // First: fetched together with the block's begin.
  LocalBlock block;
};

struct SuperBlock {
  static constexpr std::uint32_t kSide = 16;
  std::array<std::shared_ptr<BlockNode>, kSide * kSide> blocks;
  std::uint64_t epoch = 0;
};

// Copying one copies pointers.
class BlockDirectory {
 public:
  BlockDirectory(std::uint32_t blocks_north, std::uint32_t blocks_east)
      : super_rows_((blocks_north + SuperBlock::kSide - 1) / SuperBlock::kSide),
        super_cols_((blocks_east + SuperBlock::kSide - 1) / SuperBlock::kSide),
        supers_(std::size_t{super_rows_} * super_cols_) {}

  // REQUIRES: the index lies in the map. Null: never touched.
  const LocalBlock* Find(BlockIndex index) const {
    const BlockNode* node = FindNode(index);
    return node == nullptr ? nullptr : &node->block;
  }
  const BlockNode* FindNode(BlockIndex index) const {
    const SuperBlock* super = supers_[SuperOf(index)].get();
    return super == nullptr ? nullptr : super->blocks[SlotOf(index)].get();
  }

  std::uint64_t block_count() const { return block_count_; }
  std::uint64_t cells_measured() const { return cells_measured_; }
  // Soundings that wait for a second one.
  std::uint64_t pending_count() const { return pending_count_; }
  std::uint64_t memory_bytes() const;

  // Writer only, and only on a directory of its own epoch. The block, copied
  // if a view may see it; `created` tells that it did not exist before and is
  // empty. REQUIRES: the index lies in the map.
  LocalBlock& Mutable(BlockIndex index, std::uint64_t writer_epoch,
                      bool& created) {
    // The writer's own block already: nearly every sounding.
    SuperBlock* super = supers_[SuperOf(index)].get();
    if (super != nullptr && super->epoch == writer_epoch) {
      BlockNode* node = super->blocks[SlotOf(index)].get();
      if (node != nullptr && node->epoch == writer_epoch) {
        created = false;
        return node->block;
      }
    }
    return MakeMutable(index, writer_epoch, created);
  }

  // Writer only: cells were measured for the first time; a block holds more
  // memory outside itself; the same for all that a block holds, before it
  // changes (-1) and after (+1).
  void CountMeasured(std::int64_t cells) {
    cells_measured_ += static_cast<std::uint64_t>(cells);
  }
  void CountBytes(std::size_t bytes) { array_bytes_ += bytes; }
  void CountArrays(const LocalBlock& block, std::int64_t sign);

  std::uint64_t epoch() const { return epoch_; }
  void set_epoch(std::uint64_t epoch) { epoch_ = epoch; }

  // Calls visit(BlockIndex, const LocalBlock&) for each block that is not the
  // same piece in `old_directory` (null: for every block), in order of row,
  // then column. REQUIRES: both of one map.
  template <typename Visit>
  void ForEachNotIn(const BlockDirectory* old_directory, Visit visit) const;

 private:
  LocalBlock& MakeMutable(BlockIndex index, std::uint64_t writer_epoch,
                          bool& created);
  std::size_t SuperOf(BlockIndex index) const {
    return std::size_t{index.row / SuperBlock::kSide} * super_cols_ +
           index.col / SuperBlock::kSide;
  }
  static std::size_t SlotOf(BlockIndex index) {
    return std::size_t{index.row % SuperBlock::kSide} * SuperBlock::kSide +
           index.col % SuperBlock::kSide;
  }

  std::uint32_t super_rows_;
  std::uint32_t super_cols_;
  std::uint64_t epoch_ = 0;
  std::uint64_t super_count_ = 0;
  std::uint64_t block_count_ = 0;
  std::uint64_t array_bytes_ = 0;  // What blocks hold outside themselves.
  std::uint64_t cells_measured_ = 0;
  std::uint64_t pending_count_ = 0;
  std::vector<std::shared_ptr<SuperBlock>> supers_;
};

template <typename Visit>
void BlockDirectory::ForEachNotIn(const BlockDirectory* old_directory,
                                  Visit visit) const {
  for (std::uint32_t super_row = 0; super_row < super_rows_; ++super_row) {
    // Row by row through the superblocks of a band keeps the promised order.
    for (std::uint32_t in_row = 0; in_row < SuperBlock::kSide; ++in_row) {
      for (std::uint32_t super_col = 0; super_col < super_cols_; ++super_col) {
        const std::size_t at = std::size_t{super_row} * super_cols_ + super_col;
        const SuperBlock* now = supers_[at].get();
        const SuperBlock* old = old_directory == nullptr
                                    ? nullptr
                                    : old_directory->supers_[at].get();
        if (now == nullptr || now == old) continue;
        for (std::uint32_t in_col = 0; in_col < SuperBlock::kSide; ++in_col) {
          const std::size_t slot =
              std::size_t{in_row} * SuperBlock::kSide + in_col;
          const BlockNode* node = now->blocks[slot].get();
          if (node == nullptr) continue;
          if (old != nullptr && old->blocks[slot].get() == node) continue;
          visit(BlockIndex{.row = super_row * SuperBlock::kSide + in_row,
                           .col = super_col * SuperBlock::kSide + in_col},
                node->block);
        }
      }
    }
  }
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_BLOCK_DIRECTORY_H_
