#include "map/local/block_directory.h"

namespace fathom::map {

std::uint64_t BlockDirectory::memory_bytes() const {
  return sizeof(*this) + supers_.size() * sizeof(supers_[0]) +
         super_count_ * sizeof(SuperBlock) + block_count_ * sizeof(BlockNode) +
         array_bytes_;
}

LocalBlock& BlockDirectory::MakeMutable(BlockIndex index,
                                        std::uint64_t writer_epoch,
                                        bool& created) {
  std::shared_ptr<SuperBlock>& super = supers_[SuperOf(index)];
  if (super == nullptr) {
    super = std::make_shared<SuperBlock>();
    super->epoch = writer_epoch;
    ++super_count_;
  } else if (super->epoch != writer_epoch) {
    super = std::make_shared<SuperBlock>(*super);
    super->epoch = writer_epoch;
  }
  std::shared_ptr<BlockNode>& node = super->blocks[SlotOf(index)];
  created = node == nullptr;
  if (created) {
    node = std::make_shared<BlockNode>();
    node->epoch = writer_epoch;
    ++block_count_;
  } else if (node->epoch != writer_epoch) {
    node = std::make_shared<BlockNode>(*node);
    node->epoch = writer_epoch;
  }
  return node->block;
}

void BlockDirectory::CountArrays(const LocalBlock& block, std::int64_t sign) {
  const std::size_t bytes =
      block.evidence.memory_bytes() +
      block.nervegna.size() * sizeof(NervegnaCell) +
      block.pending.size() * sizeof(PendingShoal) +
      (block.prior_grid == nullptr
           ? 0
           : sizeof(PriorGrid) +
                 block.prior_grid->hazard_m.size() * sizeof(float));
  array_bytes_ += static_cast<std::uint64_t>(sign) * bytes;
  pending_count_ += static_cast<std::uint64_t>(sign) * block.pending.size();
}

}  // namespace fathom::map
