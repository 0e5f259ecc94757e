#include "occupancy/occupancy_map.h"

#include <octomap/ColorOcTree.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace tessera {
namespace {

constexpr double kLogOddsUnit = 0.001;

// In whole units, so that sums are exact, and equal where libraries differ in the last bit of a logarithm.
int64_t LogOddsOf(double probability) {
  return std::llround(std::log(probability / (1.0 - probability)) / kLogOddsUnit);
}

bool AreSame(const Rigid3& a, const Rigid3& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

}  // namespace

OccupancyMap::OccupancyMap(const OccupancyOptions& options)
    : options_(options),
      hit_(LogOddsOf(options.prob_hit)),
      miss_(LogOddsOf(options.prob_miss)),
      min_(LogOddsOf(options.prob_min)),
      max_(LogOddsOf(options.prob_max)),
      caster_(options) {
  ThrowIfFailed<std::logic_error>(options.Check());
  options_.min_hits = std::max(1, options_.min_hits);
}

void OccupancyMap::Put(KeyframeId keyframe, SharedScan scan, const Rigid3& world_from_camera) {
  const Placed* const before = Find(keyframe);
  if (before != nullptr && AreSame(before->world_from_camera, world_from_camera) &&
      (before->scan == scan || *before->scan == *scan)) {
    return;
  }
  Remove(keyframe);
  // A voxel's count has room for so many.
  if (scans_.size() == std::numeric_limits<uint16_t>::max()) throw std::length_error("the occupancy map is full");
  if (scan->is_colored() && !is_colored_) {
    is_colored_ = true;  // what was told before was told without colors
    for (const auto& [key, block] : counts_.blocks()) touched_.insert(key);
  }
  Count(scans_[keyframe] = {std::move(scan), world_from_camera}, 1);
}

void OccupancyMap::Remove(KeyframeId keyframe) {
  const auto found = scans_.find(keyframe);
  if (found == scans_.end()) return;
  Count(found->second, -1);
  scans_.erase(found);
}

const OccupancyMap::Placed* OccupancyMap::Find(KeyframeId keyframe) const {
  const auto found = scans_.find(keyframe);
  return found == scans_.end() ? nullptr : &found->second;
}

void OccupancyMap::Clear() {
  for (const auto& [key, block] : counts_.blocks()) touched_.insert(key);
  counts_.Clear();
  colors_.Clear();
  scans_.clear();
}

// The voxels that a scan sees are found again from its pose, which costs a ray casting, but keeps no list of them.
void OccupancyMap::Count(const Placed& placed, int sign) {
  const SeenVoxels seen = caster_.Cast(*placed.scan, placed.world_from_camera);
  BlockKey last = ~BlockKey{0};  // most voxels are in the block of the one before
  const auto touch = [&](const octomap::OcTreeKey& voxel) {
    const BlockKey block = BlockKeyOf(voxel);
    if (block != last) touched_.insert(block);
    last = block;
  };
  for (const SeenVoxels::Hit& hit : seen.hits) {
    Counts& counts = counts_.At(hit.voxel);
    counts.num_hits = static_cast<uint16_t>(counts.num_hits + sign);
    colors_.At(hit.voxel).Add(hit.color, sign);
    touch(hit.voxel);
  }
  for (const octomap::OcTreeKey& voxel : seen.misses) {
    Counts& counts = counts_.At(voxel);
    counts.num_misses = static_cast<uint16_t>(counts.num_misses + sign);
    touch(voxel);
  }
}

VoxelState OccupancyMap::StateOf(const Counts& counts) const {
  if (LogOdds(counts) < 0) return VoxelState::kFree;
  return counts.num_hits >= options_.min_hits ? VoxelState::kOccupied : VoxelState::kUnknown;
}

OccupancyBlock OccupancyMap::StatesOf(BlockKey key, const VoxelBlocks<Counts>::Block& counts) const {
  OccupancyBlock block = EmptyBlock(key);
  for (size_t i = 0; i < counts.size(); ++i) {
    const VoxelState state = StateOf(counts[i]);
    if (state != VoxelState::kUnknown) block.Set(i, state);
  }
  return block;
}

std::vector<OccupancyBlock> OccupancyMap::Blocks() const {
  std::vector<OccupancyBlock> blocks;
  for (const auto& [key, counts] : counts_.blocks()) {
    OccupancyBlock block = StatesOf(key, *counts);
    if (!IsEmpty(block)) blocks.push_back(block);
  }
  return blocks;
}

std::vector<OccupancyBlock> OccupancyMap::TakeChangedBlocks() {
  std::vector<OccupancyBlock> changed;
  for (const BlockKey key : touched_) {
    const auto* counts = counts_.Find(key);
    Told now{.block = counts == nullptr ? EmptyBlock(key) : StatesOf(key, *counts), .colors = {}};
    now.colors = ColorsOf({&now.block, 1});
    Told& told = told_.try_emplace(key, Told{EmptyBlock(key), {}}).first->second;
    if (now == told) continue;
    changed.push_back(now.block);
    told = std::move(now);
  }
  touched_.clear();
  return changed;
}

std::vector<Rgb> OccupancyMap::ColorsOf(std::span<const OccupancyBlock> blocks) const {
  std::vector<Rgb> colors;
  if (!is_colored_) return colors;
  for (const OccupancyBlock& block : blocks) {
    const auto* const counts = counts_.Find(KeyOf(block));
    const auto* const sums = colors_.Find(KeyOf(block));
    for (size_t i = 0; i < OccupancyBlock::kNumVoxels; ++i) {
      if (block.At(i) == VoxelState::kOccupied) colors.push_back((*sums)[i].Mean((*counts)[i].num_hits));
    }
  }
  return colors;
}

std::string OccupancyMap::ColorTreeFile() const {
  octomap::ColorOcTree tree(options_.resolution);
  tree.setProbHit(options_.prob_hit);
  tree.setProbMiss(options_.prob_miss);
  tree.setClampingThresMin(options_.prob_min);
  tree.setClampingThresMax(options_.prob_max);
  for (const auto& [key, block] : counts_.blocks()) {
    const auto* const colors = colors_.Find(key);
    for (size_t i = 0; i < block->size(); ++i) {
      const Counts& counts = (*block)[i];
      if (StateOf(counts) == VoxelState::kUnknown) continue;
      const auto log_odds =
          static_cast<float>(std::clamp(LogOdds(counts), min_, max_)) * static_cast<float>(kLogOddsUnit);
      octomap::ColorOcTreeNode* node = tree.setNodeValue(VoxelAt(key, i), log_odds, /*lazy_eval=*/true);
      if (counts.num_hits == 0) continue;
      const Rgb color = (*colors)[i].Mean(counts.num_hits);
      node->setColor(color.red, color.green, color.blue);
    }
  }
  tree.updateInnerOccupancy();
  tree.prune();
  std::ostringstream file;
  tree.write(file);
  return file.str();
}

}  // namespace tessera
