// What a keypoint measures, and where a camera at a given pose should see a landmark.
#pragma once

#include <optional>
#include <vector>

#include "features/feature_types.h"
#include "geometry/reprojection.h"
#include "map/map.h"
#include "measurement/feature_grid.h"
#include "measurement/frame_view.h"

namespace tessera {

inline constexpr int kTopLevel = FeatureOptions{}.num_levels - 1;  // as DescribeLandmark takes it

// Standard deviation of a keypoint's coordinates, pixels of its level: what residuals of bundle adjustment show (0.55),
// and some of the map's error. A wider one lets corners in that only look alike; they make motion come out too small.
inline constexpr double kKeypointSigmaPx = 0.7;

// A structured-light camera measures depth as a disparity over the distance of projector and camera: 75 mm in those in
// use (Kinect, Xtion). The stereo baseline for a stereo camera; 0 for mono.
inline constexpr double kRgbdBaseline = 0.075;
double Baseline(const CameraCalibration& calibration);

// Depths (z) of the landmarks in front of a keyframe that it sees, rising.
std::vector<double> LandmarkDepths(const Map& map, const Keyframe& keyframe);
// Their median; 1 if there are none.
double MedianDepth(const Map& map, const Keyframe& keyframe);

// The features' keypoints by place.
FeatureGrid MakeGrid(const FeatureFrame& features);

// The keypoint as a measurement; a depth as the right column that it stands for.
PixelObservation SeenAt(const FeatureFrame& features, int32_t keypoint);

// The keypoint's point by its own depth or right column, in the camera frame; nullopt where it has none.
std::optional<Eigen::Vector3d> PointFromDepth(const FeatureFrame& features, int32_t keypoint);

// A camera at a pose, ready to project many landmarks.
struct View {
  View(const CameraCalibration& camera, const Rigid3& world_from_camera);

  CameraCalibration calibration;
  Eigen::Matrix3d rotation;  // camera_from_world
  Eigen::Vector3d translation;
  Eigen::Vector3d camera_in_world;
};

struct ExpectedView {
  Eigen::Vector2d pixel_px;
  double depth = 0.0;      // z in the camera frame
  double distance = 0.0;   // from the camera's centre
  int level = 0;           // where its patch has the size that it had before
  double cos_angle = 1.0;  // between the line of sight and the landmark's mean one
};

// nullopt where the landmark stands behind the camera or off the image, too near or too far for its patch to be found
// (with a fifth of tolerance), or is seen from more than 60 degrees aside of its normal.
std::optional<ExpectedView> Expect(const View& view, const Landmark& landmark);

// Whether two orientations (1/256 turn) differ by `expected` up to 30 degrees.
inline bool AreAnglesNear(uint8_t a, uint8_t b, uint8_t expected = 0) {
  const auto difference = static_cast<uint8_t>(b - a - expected);
  return difference <= 21 || difference >= 256 - 21;
}

// By how much the image turns about the optical axis from one camera to another, in 1/256 turn.
uint8_t RollBetween(const Rigid3& second_from_first);

}  // namespace tessera
