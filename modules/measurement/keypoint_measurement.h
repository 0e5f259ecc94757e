// What a keypoint measures, and how exactly.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "features/feature_types.h"
#include "features/pyramid.h"
#include "geometry/keypoint_noise.h"
#include "geometry/reprojection.h"

namespace tessera {

// A structured-light camera measures depth as a disparity over the distance of projector and camera: 75 mm in those in
// use (Kinect, Xtion).
inline constexpr double kRgbdBaseline = 0.075;
// How exactly, in pixels of the color image, at corners: the sensor's own disparities come in steps of 1/8 px with a
// noise of about half a step (K. Khoshelham, S. Elberink, "Accuracy and Resolution of Kinect Depth Data", Sensors
// 2012); the rest is how far the two images are from showing a corner at the same pixel.
inline constexpr double kRgbdDisparitySigmaPx = 0.2;
// Baseline that turns depths into right columns, meters: the pair's, or that virtual one; 0 for mono.
double Baseline(const CameraCalibration& calibration);

// The keypoint as a measurement, with the noise of its level; a depth as the right column that it stands for.
inline PixelObservation SeenAt(const FeatureFrame& features, int32_t keypoint) {
  const Keypoint& k = features.keypoints[static_cast<size_t>(keypoint)];
  PixelObservation seen{
      {k.x_px, k.y_px}, kNoColumn, KeypointSigmaPx(features.calibration.sensor) * LevelScale(k.level)};
  if (features.calibration.sensor == SensorType::kStereo) {
    seen.right_x_px = k.right_x_px >= 0.0F && k.right_x_px < k.x_px ? k.right_x_px : kNoColumn;
  } else if (features.calibration.sensor == SensorType::kRgbd && k.depth_m > 0.0F) {
    seen.right_x_px = k.x_px - features.calibration.fx_px * kRgbdBaseline / k.depth_m;
    seen.disparity_sigma_px = kRgbdDisparitySigmaPx;
  }
  return seen;
}

// The keypoint's point by its own depth or right column, in the camera frame; nullopt where it has none.
std::optional<Eigen::Vector3d> PointFromDepth(const FeatureFrame& features, int32_t keypoint);

}  // namespace tessera
