// Which keypoints with depth become points by themselves.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/result.h"
#include "features/feature_types.h"

namespace tessera {

struct DepthPointOptions {
  double max_baselines = 40.0;  // a depth of up to this many baselines is good enough by itself (ORB-SLAM2: 35, 40)
  // And any depth is while the image shows fewer points than this, nearest first. What isn't known of it counts
  // (Landmark::depth_sigma), and where the camera turns and walks on, far points are all that two images share.
  int min_points = 1000;

  // Fails if a value is out of range.
  Result<> Check() const;
};

struct DepthPoint {
  int32_t keypoint = -1;
  Eigen::Vector3d point_in_camera = Eigen::Vector3d::Zero();
};

// Those of the keypoints that see no known point, nearest first. Tracker and mapper ask alike.
std::vector<DepthPoint> NewDepthPoints(const FeatureFrame& features,
                                       const std::function<bool(int32_t keypoint)>& sees_known,
                                       const DepthPointOptions& options);

}  // namespace tessera
