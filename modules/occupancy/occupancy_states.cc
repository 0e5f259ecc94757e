#include "occupancy/occupancy_states.h"

#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>

namespace tessera {
namespace {

// OctoMap counts voxels, and we blocks, from the lowest corner of its space; messages from the origin of the world.
constexpr int32_t kOriginBlock = (1 << 15) / OccupancyBlock::kSide;
constexpr double kOriginVoxel = 1 << 15;
constexpr double kNumKeys = 1 << 16;

int32_t PartOf(BlockKey key, int axis) { return static_cast<int32_t>((key >> (12 * axis)) & 0xFFF) - kOriginBlock; }

// `paint(node, key, number)`: of the occupied voxel `number` of a block.
template <class Tree, class Paint>
void FillTree(const std::map<BlockKey, OccupancyBlock>& blocks, Tree& tree, Paint paint) {
  for (const auto& [key, block] : blocks) {
    size_t num_occupied = 0;
    for (size_t i = 0; i < OccupancyBlock::kNumVoxels; ++i) {
      if (block.At(i) == VoxelState::kUnknown) continue;
      const bool is_occupied = block.At(i) == VoxelState::kOccupied;
      const float log_odds = is_occupied ? tree.getClampingThresMaxLog() : tree.getClampingThresMinLog();
      auto* const node = tree.setNodeValue(VoxelAt(key, i), log_odds, /*lazy_eval=*/true);
      if (is_occupied) paint(*node, key, num_occupied++);
    }
  }
  tree.updateInnerOccupancy();
}

}  // namespace

OccupancyBlock EmptyBlock(BlockKey key) { return {.x = PartOf(key, 0), .y = PartOf(key, 1), .z = PartOf(key, 2)}; }

bool IsEmpty(const OccupancyBlock& block) {
  return std::all_of(block.states.begin(), block.states.end(), [](uint8_t states) { return states == 0; });
}

BlockKey KeyOf(const OccupancyBlock& block) {
  const auto part = [](int32_t index) { return static_cast<BlockKey>(index + kOriginBlock); };
  return part(block.x) | part(block.y) << 12 | part(block.z) << 24;
}

void OccupancyStates::Set(std::span<const OccupancyBlock> blocks, std::span<const Rgb> colors) {
  for (const OccupancyBlock& block : blocks) {
    const BlockKey key = KeyOf(block);
    if (IsEmpty(block)) {
      blocks_.erase(key);
    } else {
      blocks_.insert_or_assign(key, block);
    }
    colors_.erase(key);
    if (colors.empty()) continue;
    const size_t num = block.NumOccupied();
    if (num > 0) colors_[key].assign(colors.begin(), colors.begin() + static_cast<std::ptrdiff_t>(num));
    colors = colors.subspan(num);
  }
}

void OccupancyStates::Clear() {
  blocks_.clear();
  colors_.clear();
}

int64_t OccupancyStates::Num(VoxelState state) const {
  int64_t num = 0;
  for (const auto& [key, block] : blocks_) {
    for (size_t i = 0; i < OccupancyBlock::kNumVoxels; ++i) num += block.At(i) == state ? 1 : 0;
  }
  return num;
}

VoxelState OccupancyStates::At(const Eigen::Vector3d& point_in_world) const {
  octomap::OcTreeKey voxel;
  for (unsigned axis = 0; axis < 3; ++axis) {
    const double key = std::floor(point_in_world[axis] / resolution_) + kOriginVoxel;
    if (!(key >= 0.0 && key < kNumKeys)) return VoxelState::kUnknown;
    voxel[axis] = static_cast<octomap::key_type>(key);
  }
  const auto found = blocks_.find(BlockKeyOf(voxel));
  return found == blocks_.end() ? VoxelState::kUnknown : found->second.At(PlaceInBlock(voxel));
}

std::string OccupancyStates::BinaryTreeFile() const {
  octomap::OcTree tree(resolution_);
  FillTree(blocks_, tree, [](octomap::OcTreeNode&, BlockKey, size_t) {});
  std::ostringstream file;
  tree.writeBinary(file);  // prunes
  return file.str();
}

std::string OccupancyStates::ColorTreeFile() const {
  octomap::ColorOcTree tree(resolution_);
  FillTree(blocks_, tree, [&](octomap::ColorOcTreeNode& node, BlockKey key, size_t number) {
    const auto colors = colors_.find(key);
    if (colors == colors_.end()) return;
    const Rgb& color = colors->second[number];
    node.setColor(color.red, color.green, color.blue);
  });
  tree.prune();
  std::ostringstream file;
  tree.write(file);
  return file.str();
}

}  // namespace tessera
