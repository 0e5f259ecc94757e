// Which voxels one scan sees: those that hold a point of it, and those that its rays go through.
#pragma once

#include <octomap/OcTree.h>

#include <vector>

#include "geometry/rigid3.h"
#include "occupancy/color_sum.h"
#include "occupancy/occupancy_options.h"
#include "occupancy/scan.h"
#include "occupancy/voxel_blocks.h"

namespace tessera {

struct SeenVoxels {
  struct Hit {
    octomap::OcTreeKey voxel;
    Rgb color;  // mean of its points
  };
  std::vector<Hit> hits;                   // each voxel once
  std::vector<octomap::OcTreeKey> misses;  // each voxel once; no hit is among them
};

class RayCaster {
 public:
  explicit RayCaster(const OccupancyOptions& options)
      : min_range_(options.min_range), max_range_(options.max_range), tree_(options.resolution) {}

  // A function of its arguments alone. Rays are OctoMap's (J. Amanatides, A. Woo, "A Fast Voxel Traversal Algorithm for
  // Ray Tracing", 1987), one to the center of each voxel that holds points. Rays to points beyond the maximum range end
  // there, and hit nothing. Points nearer than the minimum, not in front of the camera, or out of OctoMap's space, are
  // passed over.
  SeenVoxels Cast(const Scan& scan, const Rigid3& world_from_camera);

 private:
  // A voxel in which rays end.
  struct End {
    octomap::OcTreeKey voxel;
    uint32_t num_points = 0;  // within the range
    ColorSum color_sum;
  };
  // What is known of a voxel while one scan is cast: kUntouched, kMissed, or else one more than its index in `ends`.
  using Mark = uint32_t;
  std::vector<End> CollectEnds(const Scan& scan, const Rigid3& world_from_camera, VoxelBlocks<Mark>& marks) const;

  double min_range_, max_range_;
  octomap::OcTree tree_;  // holds no nodes: it knows the keys of voxels
  octomap::KeyRay ray_;
};

}  // namespace tessera
