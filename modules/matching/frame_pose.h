// The pose of a frame from the points that it sees.
#pragma once

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"

namespace tessera {

// Optimizes the frame's pose over its points, from the pose that it has, and removes the outliers. Returns the number
// of points that are left.
int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame);

// The same with a prior (nullptr: none), and all that is known of the result.
PoseOptimizationResult OptimizeFramePose(const PoseOptimizationOptions& options, const PosePrior* prior,
                                         TrackedFrame& frame);

}  // namespace tessera
