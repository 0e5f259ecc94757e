// The pose of a frame from the points that it sees.
#pragma once

#include <span>

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"

namespace tessera {

// Optimizes the frame's pose over its points, from the pose that it has, and removes the outliers. Returns the number
// of points that are left.
int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame);

// The first of these two steps: the frame's pose by the points that it sees, which are the observations, in the order
// of keypoints. `votes`: PoseObservation::votes of each (empty: all do); `prior`: nullptr: none.
PoseOptimizationResult PoseByPoints(const PoseOptimizationOptions& options, const PosePrior* prior,
                                    const TrackedFrame& frame, std::span<const char> votes = {});
// The second: the frame takes that pose and loses its outliers.
void TakePose(const PoseOptimizationResult& pose, TrackedFrame& frame);

}  // namespace tessera
