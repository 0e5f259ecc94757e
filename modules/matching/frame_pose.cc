#include "matching/frame_pose.h"

#include <vector>

namespace tessera {

int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame) {
  std::vector<PoseObservation> observations;
  std::vector<size_t> keypoints;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    observations.push_back({.point_in_world = frame.points[i].landmark.position_in_world,
                            .seen = frame.view->observation(static_cast<int>(i))});
    keypoints.push_back(i);
  }
  const PoseOptimizationResult result = OptimizePose(frame.view->calibration(), frame.view->baseline_m(), observations,
                                                     frame.world_from_camera.Inverse(), options);
  frame.world_from_camera = result.camera_from_world.Inverse();
  for (size_t k = 0; k < keypoints.size(); ++k) {
    if (!result.is_inlier[k]) frame.points[keypoints[k]] = {};
  }
  return result.num_inliers;
}

}  // namespace tessera
