#include "measurement/depth_points.h"

#include <algorithm>

#include "measurement/keypoint_measurement.h"

namespace tessera {

Result<> DepthPointOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(Require(max_baselines >= 0.0, "max_baselines must not be negative"));
  return Require(min_points >= 0, "min_points must not be negative");
}

std::vector<DepthPoint> NewDepthPoints(const FeatureFrame& features,
                                       const std::function<bool(int32_t keypoint)>& sees_known,
                                       const DepthPointOptions& options) {
  std::vector<DepthPoint> points;
  int num_known = 0;
  for (int32_t i = 0; i < static_cast<int32_t>(features.keypoints.size()); ++i) {
    if (sees_known(i)) {
      ++num_known;
    } else if (const auto point = PointFromDepth(features, i)) {
      points.push_back({i, *point});
    }
  }
  const auto depth_of = [](const DepthPoint& point) { return point.point_in_camera.z(); };
  std::ranges::stable_sort(points, {}, depth_of);
  const double max_depth_m = options.max_baselines * Baseline(features.calibration);
  const auto num_near = std::ranges::upper_bound(points, max_depth_m, {}, depth_of) - points.begin();
  const auto num_wanted = std::max<ptrdiff_t>(num_near, options.min_points - num_known);
  points.resize(std::min(points.size(), static_cast<size_t>(num_wanted)));
  return points;
}

}  // namespace tessera
