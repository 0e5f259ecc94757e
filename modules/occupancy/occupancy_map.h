// An occupancy map made of keyframes' scans, each of which can be moved or taken out again.
//
// A voxel counts the scans that hit it (h: they have a point in it) and those that miss it (m: rays go through it, and
// they have no point in it). What it is follows from the counts alone,
//
//   L = h * log(prob_hit / (1 - prob_hit)) + m * log(prob_miss / (1 - prob_miss))      log-odds, in steps of 1/1000
//   occupied if L >= 0 and h >= min_hits; free if L < 0; else unknown
//
// which is the update of A. Hornung et al., "OctoMap: An Efficient Probabilistic 3D Mapping Framework Based on
// Octrees", Autonomous Robots 2013, with its bounds applied to the sum instead of to each term. Counts are integers,
// and adding them can be undone. So the map depends on the scans and their poses, not on the way that led to it: moving
// a scan gives, bit for bit, the map that would have been made with the scan there from the beginning.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/ids.h"
#include "geometry/rigid3.h"
#include "messages/occupancy_types.h"
#include "occupancy/color_sum.h"
#include "occupancy/occupancy_options.h"
#include "occupancy/occupancy_states.h"
#include "occupancy/ray_caster.h"
#include "occupancy/scan.h"
#include "occupancy/voxel_blocks.h"

namespace tessera {

class OccupancyMap {
 public:
  using SharedScan = std::shared_ptr<const Scan>;
  // A scan of the map, and where it was cast.
  struct Placed {
    SharedScan scan;
    Rigid3 world_from_camera;
  };

  // Throws std::logic_error if the options do not pass their Check().
  explicit OccupancyMap(const OccupancyOptions& options);

  // Adds the scan of a keyframe, or replaces the one that it had, or its pose.
  void Put(KeyframeId keyframe, SharedScan scan, const Rigid3& world_from_camera);
  // Takes it out; nothing happens if there is none.
  void Remove(KeyframeId keyframe);
  // Null if the map has no scan of this keyframe.
  const Placed* Find(KeyframeId keyframe) const;
  void Clear();

  const OccupancyOptions& options() const { return options_; }
  const std::map<KeyframeId, Placed>& scans() const { return scans_; }
  int64_t num_blocks() const { return static_cast<int64_t>(counts_.blocks().size()); }

  // All blocks in which something is known, by key.
  std::vector<OccupancyBlock> Blocks() const;
  // Those whose states or colors differ from what the last call returned.
  std::vector<OccupancyBlock> TakeChangedBlocks();
  // Of the occupied voxels of these blocks of the map, in their order; empty if no scan was in color.
  std::vector<Rgb> ColorsOf(std::span<const OccupancyBlock> blocks) const;

  // OctoMap's file of log-odds and colors (a ColorOcTree, `.ot`): the sum L of each voxel within the bounds of the
  // options, and the mean color of its hits.
  std::string ColorTreeFile() const;

 private:
  struct Counts {
    uint16_t num_hits = 0;
    uint16_t num_misses = 0;
  };
  struct Told {
    OccupancyBlock block;
    std::vector<Rgb> colors;
    bool operator==(const Told&) const = default;
  };
  VoxelState StateOf(const Counts& counts) const;
  void Count(const Placed& placed, int sign);
  int64_t LogOdds(const Counts& counts) const { return counts.num_hits * hit_ + counts.num_misses * miss_; }
  OccupancyBlock StatesOf(BlockKey key, const VoxelBlocks<Counts>::Block& counts) const;

  OccupancyOptions options_;        // min_hits is at least 1
  int64_t hit_, miss_, min_, max_;  // log-odds, 1/1000
  RayCaster caster_;
  VoxelBlocks<Counts> counts_;
  VoxelBlocks<ColorSum> colors_;  // over the scans that hit it; in most blocks nothing is hit
  std::map<KeyframeId, Placed> scans_;
  bool is_colored_ = false;        // a scan was in color
  std::set<BlockKey> touched_;     // since TakeChangedBlocks() was called last
  std::map<BlockKey, Told> told_;  // what it returned
};

}  // namespace tessera
