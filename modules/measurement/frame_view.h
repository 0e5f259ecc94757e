// A frame's features made ready for matching and geometry.
#pragma once

#include <cmath>
#include <cstdint>

#include "features/feature_types.h"
#include "features/pyramid.h"
#include "geometry/reprojection.h"
#include "measurement/feature_grid.h"

namespace tessera {

// Never changes once made; keyframes share it with the frame that they came from.
class FrameView {
 public:
  // sigma_px: standard deviation of a keypoint's coordinates at level 0. rgbd_baseline_m: see PixelObservation; stereo
  // has its own baseline. Keypoints without a descriptor, or descriptors without a keypoint, are left out.
  FrameView(FeatureFrame features, double sigma_px, double rgbd_baseline_m);

  const FeatureFrame& features() const { return features_; }
  const CameraCalibration& calibration() const { return features_.calibration; }
  const FeatureGrid& grid() const { return grid_; }
  int size() const { return static_cast<int>(features_.keypoints.size()); }
  // Baseline that turns depths into right columns: the pair's, or the virtual one; 0 for mono.
  double baseline_m() const { return baseline_m_; }

  const Keypoint& keypoint(int i) const { return features_.keypoints[static_cast<size_t>(i)]; }
  const Descriptor& descriptor(int i) const { return features_.descriptors[static_cast<size_t>(i)]; }
  Eigen::Vector2d pixel(int i) const { return {keypoint(i).x_px, keypoint(i).y_px}; }
  // Column in the right image, measured or from the depth; kNoColumn: none.
  double right_x_px(int i) const;
  PixelObservation observation(int i) const;
  double sigma_px(int level) const { return sigma_px_ * LevelScale(level); }
  Eigen::Vector3d ray(int i) const { return calibration().Ray(pixel(i)); }

 private:
  FeatureFrame features_;
  FeatureGrid grid_;
  double sigma_px_ = 1.0;
  double baseline_m_ = 0.0;
};

}  // namespace tessera
