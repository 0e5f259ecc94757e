// What is known of space as a whole, as it was told block by block; the octree and the lookup of points in it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "messages/occupancy_types.h"
#include "occupancy/voxel_blocks.h"

namespace tessera {

// Nothing is known in it.
OccupancyBlock EmptyBlock(BlockKey key);
bool IsEmpty(const OccupancyBlock& block);
BlockKey KeyOf(const OccupancyBlock& block);

class OccupancyStates {
 public:
  // `resolution`: edge of a voxel, m (mono: units of the map).
  explicit OccupancyStates(double resolution) : resolution_(resolution) {}

  // Blocks replace what was known of theirs.
  void Set(std::span<const OccupancyBlock> blocks);
  void Clear() { blocks_.clear(); }

  double resolution() const { return resolution_; }
  // By key; none is empty.
  const std::map<BlockKey, OccupancyBlock>& blocks() const { return blocks_; }
  int64_t Num(VoxelState state) const;

  VoxelState At(const Eigen::Vector3d& point_in_world) const;

  // OctoMap's binary file (`.bt`): voxels are free, occupied or not there.
  std::string BinaryTreeFile() const;

 private:
  double resolution_;
  std::map<BlockKey, OccupancyBlock> blocks_;
};

}  // namespace tessera
