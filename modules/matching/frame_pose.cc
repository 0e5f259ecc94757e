#include "matching/frame_pose.h"

#include <vector>

namespace tessera {

int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame) {
  return OptimizeFramePose(options, nullptr, frame).num_inliers;
}

PoseOptimizationResult OptimizeFramePose(const PoseOptimizationOptions& options, const PosePrior* prior,
                                         TrackedFrame& frame) {
  std::vector<PoseObservation> observations;
  std::vector<size_t> keypoints;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Landmark& landmark = frame.points[i].landmark;
    observations.push_back({.point_in_world = landmark.position_in_world,
                            .depth_sigma_in_world = landmark.depth_sigma * landmark.normal,
                            .seen = frame.view->observation(static_cast<int>(i))});
    keypoints.push_back(i);
  }
  PoseOptimizationResult result = OptimizePose(frame.view->calibration(), frame.view->baseline_m(), observations,
                                               frame.world_from_camera.Inverse(), options, prior);
  frame.world_from_camera = result.camera_from_world.Inverse();
  for (size_t k = 0; k < keypoints.size(); ++k) {
    if (!result.is_inlier[k]) frame.points[keypoints[k]] = {};
  }
  return result;
}

}  // namespace tessera
