// The pose of a frame in which something moves.
#pragma once

#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"
#include "tracking/map_replica.h"

namespace tessera {

// Fewer confirmed points (see below) fix no pose by themselves.
inline constexpr int kMinConfirmed = 25;

struct PoseByConfirmed {
  PoseOptimizationResult optimized;
  int num_confirmed_matches = 0;  // of the points that the frame saw
  int num_confirmed = 0;          // of these, with which the pose agrees
};

// The frame takes the pose by all points that it sees, and loses the outliers (PoseByPoints, TakePose), unless those
// that are confirmed contradict it: three keyframes, half a second apart or more, saw each of these where it is, so it
// stood still that long. A person who walks by, or a bus, can fill the image with points, and each keyframe brings more
// of them; but they have gone before they are confirmed. Where the pose by the confirmed points alone fits these
// better, the frame takes that one, and keeps all points that agree with it.
PoseByConfirmed OptimizeByConfirmed(const MapReplica& replica, const PoseOptimizationOptions& options,
                                    const PosePrior* prior, TrackedFrame& frame);

// How many of the points that the frame sees are confirmed.
int NumConfirmed(const MapReplica& replica, const TrackedFrame& frame);
// Those of the points that are.
KnownPoints OnlyConfirmed(const MapReplica& replica, KnownPoints points);

}  // namespace tessera
