// The pose of a frame in which something moves.
#pragma once

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"
#include "tracking/map_replica.h"

namespace tessera {

// As OptimizeFramePose, over all points that the frame sees, unless those that are confirmed contradict it: three
// keyframes, half a second apart or more, saw each of them where it is, so it stood still that long. A person who walks
// by, or a bus, can fill the image with points, and each keyframe brings more of them; but they have gone before they
// are confirmed. Where a pose of the confirmed points alone has more of these as inliers, it holds, and what agrees
// with it is kept.
PoseOptimizationResult OptimizeByConfirmed(const MapReplica& replica, const PoseOptimizationOptions& options,
                                           const PosePrior* prior, TrackedFrame& frame);

}  // namespace tessera
