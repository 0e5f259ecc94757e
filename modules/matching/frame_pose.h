// The pose of a frame from the points that it sees.
#pragma once

#include <span>

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"

namespace tessera {

// Optimizes the frame's pose over its points, from the pose that it has, and removes the outliers. Returns the number
// of points that are left.
int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame);

// The same with a prior (nullptr: none), and all that is known of the result.
PoseOptimizationResult OptimizeFramePose(const PoseOptimizationOptions& options, const PosePrior* prior,
                                         TrackedFrame& frame);

// In two steps: what the pose would be, an observation for each point that the frame sees, in the order of keypoints;
// `votes` (by keypoint; empty: all) tells whose points take part. And the frame with that pose, without its outliers.
PoseOptimizationResult PoseByPoints(const PoseOptimizationOptions& options, const PosePrior* prior,
                                    const TrackedFrame& frame, std::span<const char> votes = {});
void TakePose(const PoseOptimizationResult& pose, TrackedFrame& frame);

}  // namespace tessera
