// A value for each voxel of space, stored in blocks of those that were ever touched.
#pragma once

#include <octomap/OcTreeKey.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>

#include "messages/occupancy_types.h"

namespace tessera {

// A block's place among all of OctoMap's space, 12 bits for each axis: z is the highest.
using BlockKey = uint64_t;

inline constexpr int kBlockBits = 4;  // of a voxel's key are its place within the block
static_assert(OccupancyBlock::kSide == 1 << kBlockBits);

inline BlockKey BlockKeyOf(const octomap::OcTreeKey& voxel) {
  const auto part = [&](unsigned axis) { return BlockKey{voxel[axis]} >> kBlockBits; };
  return part(0) | part(1) << 12 | part(2) << 24;
}
// The voxel's number within its block, as in OccupancyBlock.
inline size_t PlaceInBlock(const octomap::OcTreeKey& voxel) {
  constexpr unsigned kMask = OccupancyBlock::kSide - 1;
  return (voxel[0] & kMask) | (voxel[1] & kMask) << kBlockBits | (voxel[2] & kMask) << (2 * kBlockBits);
}
inline octomap::OcTreeKey VoxelAt(BlockKey block, size_t place) {
  const auto key = [&](unsigned axis) {
    const auto high = (block >> (12 * axis)) & 0xFFF;
    const auto low = (place >> (kBlockBits * axis)) & (OccupancyBlock::kSide - 1);
    return static_cast<octomap::key_type>(high << kBlockBits | low);
  };
  return {key(0), key(1), key(2)};
}

template <class Value>
class VoxelBlocks {
 public:
  using Block = std::array<Value, OccupancyBlock::kNumVoxels>;

  // The value of a voxel, made if need be. Voxels of one block after another are found at once.
  Value& At(const octomap::OcTreeKey& voxel) {
    const BlockKey key = BlockKeyOf(voxel);
    if (last_ == nullptr || key != last_key_) {
      std::unique_ptr<Block>& block = blocks_[key];
      if (!block) block = std::make_unique<Block>();
      last_ = block.get();
      last_key_ = key;
    }
    return (*last_)[PlaceInBlock(voxel)];
  }
  const Block* Find(BlockKey key) const {
    const auto found = blocks_.find(key);
    return found == blocks_.end() ? nullptr : found->second.get();
  }
  void Clear() {
    blocks_.clear();
    last_ = nullptr;
  }
  // By key.
  const std::map<BlockKey, std::unique_ptr<Block>>& blocks() const { return blocks_; }

 private:
  std::map<BlockKey, std::unique_ptr<Block>> blocks_;
  Block* last_ = nullptr;  // the block that was asked for last
  BlockKey last_key_ = 0;
};

}  // namespace tessera
