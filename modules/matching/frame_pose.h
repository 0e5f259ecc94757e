// The pose of a frame from the points that it sees.
#pragma once

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"

namespace tessera {

// Optimizes the frame's pose over its points, from the pose that it has, and removes the outliers. Returns the number
// of points that are left.
int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame);

}  // namespace tessera
