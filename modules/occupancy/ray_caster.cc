#include "occupancy/ray_caster.h"

#include <Eigen/Core>

namespace tessera {
namespace {

constexpr uint32_t kUntouched = 0;
constexpr uint32_t kMissed = 0xFFFFFFFF;

octomap::point3d ToOctomap(const Eigen::Vector3d& point) {
  return {static_cast<float>(point.x()), static_cast<float>(point.y()), static_cast<float>(point.z())};
}

}  // namespace

std::vector<RayCaster::End> RayCaster::CollectEnds(const Scan& scan, const Rigid3& world_from_camera,
                                                   VoxelBlocks<Mark>& marks) const {
  std::vector<End> ends;
  const Eigen::Matrix3d rotation = world_from_camera.rotation.toRotationMatrix();
  for (const ScanPoint& point : PointsOf(scan)) {
    if (point.in_camera.z() <= 0.0) continue;
    const double range = point.in_camera.norm();
    if (range < min_range_) continue;
    const bool is_within = range <= max_range_;
    const double share = is_within ? 1.0 : max_range_ / range;
    const Eigen::Vector3d in_world = rotation * (share * point.in_camera) + world_from_camera.translation;
    octomap::OcTreeKey voxel;
    if (!tree_.coordToKeyChecked(ToOctomap(in_world), voxel)) continue;
    Mark& mark = marks.At(voxel);
    if (mark == kUntouched) {
      ends.push_back({voxel});
      mark = static_cast<Mark>(ends.size());
    }
    if (!is_within) continue;
    End& end = ends[mark - 1];
    ++end.num_points;
    end.color_sum.Add(point.color);
  }
  return ends;
}

SeenVoxels RayCaster::Cast(const Scan& scan, const Rigid3& world_from_camera) {
  SeenVoxels seen;
  const octomap::point3d origin = ToOctomap(world_from_camera.translation);
  octomap::OcTreeKey origin_voxel;
  if (!tree_.coordToKeyChecked(origin, origin_voxel)) return seen;
  VoxelBlocks<Mark> marks;
  for (const End& end : CollectEnds(scan, world_from_camera, marks)) {
    if (end.num_points > 0) {
      seen.hits.push_back({end.voxel, end.color_sum.Mean(end.num_points)});
    } else {
      seen.misses.push_back(end.voxel);
    }
    const octomap::point3d to_end = tree_.keyToCoord(end.voxel) - origin;
    const double distance = to_end.norm();
    const double free_distance = distance - UncertaintyAt(distance, scan.camera);
    if (free_distance <= 0.0) continue;
    tree_.computeRayKeys(origin, origin + to_end * static_cast<float>(free_distance / distance), ray_);
    for (const octomap::OcTreeKey& voxel : ray_) {
      Mark& mark = marks.At(voxel);
      if (mark != kUntouched) continue;
      mark = kMissed;
      seen.misses.push_back(voxel);
    }
  }
  return seen;
}

}  // namespace tessera
