#include "matching/frame_pose.h"

#include <vector>

#include "measurement/landmark_view.h"

namespace tessera {

int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame) {
  const PoseOptimizationResult pose = PoseByPoints(options, nullptr, frame);
  TakePose(pose, frame);
  return pose.num_inliers;
}

PoseOptimizationResult PoseByPoints(const PoseOptimizationOptions& options, const PosePrior* prior,
                                    const TrackedFrame& frame, std::span<const char> votes) {
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Landmark& landmark = frame.points[i].landmark;
    observations.push_back(
        {.point_in_world = landmark.position_in_world,
         .depth_sigma_in_world = landmark.depth_sigma * landmark.normal,
         .seen = SeenAt(frame.view->features(), static_cast<int32_t>(i), landmark, frame.world_from_camera.translation),
         .votes = votes.empty() || votes[observations.size()] != 0});
  }
  return OptimizePose(frame.view->calibration(), frame.view->baseline_m(), observations,
                      frame.world_from_camera.Inverse(), options, prior);
}

void TakePose(const PoseOptimizationResult& pose, TrackedFrame& frame) {
  frame.world_from_camera = pose.camera_from_world.Inverse();
  size_t k = 0;
  for (SeenPoint& point : frame.points) {
    if (point.valid() && !pose.is_inlier[k++]) point = {};
  }
}

}  // namespace tessera
