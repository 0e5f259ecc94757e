// A frame's features made ready for matching and geometry.
#pragma once

#include <cstdint>

#include "core/time_units.h"
#include "features/feature_types.h"
#include "geometry/reprojection.h"
#include "measurement/feature_grid.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {

// Never changes once made; keyframes share it with the frame that they came from.
class FrameView {
 public:
  // Keypoints without a descriptor, or descriptors without a keypoint, are left out.
  explicit FrameView(FeatureFrame features);

  const FeatureFrame& features() const { return features_; }
  const CameraCalibration& calibration() const { return features_.calibration; }
  const FeatureGrid& grid() const { return grid_; }
  int size() const { return static_cast<int>(features_.keypoints.size()); }
  // As in Baseline().
  double baseline_m() const { return baseline_m_; }

  const Keypoint& keypoint(int i) const { return features_.keypoints[static_cast<size_t>(i)]; }
  const Descriptor& descriptor(int i) const { return features_.descriptors[static_cast<size_t>(i)]; }
  Eigen::Vector2d pixel(int i) const { return {keypoint(i).x_px, keypoint(i).y_px}; }
  PixelObservation observation(int i) const { return SeenAt(features_, i); }

 private:
  FeatureFrame features_;
  FeatureGrid grid_;
  double baseline_m_ = 0.0;
};

inline double SecondsBetween(const FrameView& first, const FrameView& second) {
  return SecondsOf(second.features().utime_us - first.features().utime_us);
}

}  // namespace tessera
