// What is known of space as a whole, as it was told block by block; the octree and the lookup of points in it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

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

  // Blocks replace what was known of theirs. `colors`: of their occupied voxels, in their order; empty: not known.
  void Set(std::span<const OccupancyBlock> blocks, std::span<const Rgb> colors = {});
  void Clear();

  double resolution() const { return resolution_; }
  // By key; none is empty.
  const std::map<BlockKey, OccupancyBlock>& blocks() const { return blocks_; }
  int64_t Num(VoxelState state) const;

  VoxelState At(const Eigen::Vector3d& point_in_world) const;

  // OctoMap's binary file (`.bt`): voxels are free, occupied or not there.
  std::string BinaryTreeFile() const;
  // OctoMap's file of a ColorOcTree (`.ot`): likewise, and the colors of the occupied ones, white where not known.
  std::string ColorTreeFile() const;

 private:
  double resolution_;
  std::map<BlockKey, OccupancyBlock> blocks_;
  std::map<BlockKey, std::vector<Rgb>> colors_;  // of the occupied voxels of those whose colors are known
};

}  // namespace tessera
