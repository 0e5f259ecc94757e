// The pose of a frame from the points that it sees.
#pragma once

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"

namespace tessera {

// Moves the frame to the pose that agrees best with its points, from where it stands, and takes off the points that
// disagree. Returns how many are left.
int OptimizeFrame(const PoseOptimizationOptions& options, TrackedFrame& frame);

}  // namespace tessera
