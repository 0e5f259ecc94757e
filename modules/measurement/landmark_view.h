// Where a camera at a given pose should see a landmark.
#pragma once

#include <optional>
#include <vector>

#include "features/feature_types.h"
#include "map/map.h"
#include "measurement/feature_grid.h"
#include "measurement/frame_view.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {

// Depths (z) of the landmarks in front of a keyframe that it sees and whose depth is known, rising.
std::vector<double> LandmarkDepths(const Map& map, const Keyframe& keyframe);
// Their median; 1 if there are none.
double MedianDepth(const Map& map, const Keyframe& keyframe);

// The features' keypoints by position.
FeatureGrid MakeGrid(const FeatureFrame& features);

bool IsInImage(const CameraCalibration& camera, const Eigen::Vector2d& pixel_px);

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
  double distance = 0.0;   // from the camera's center
  int level = 0;           // where its patch has the size that it had before
  double cos_angle = 1.0;  // between the line of sight and the landmark's mean one
};

// nullopt where the landmark stands behind the camera or off the image, too near or too far for its patch to be found
// (with a fifth of tolerance), or is seen from more than 60 degrees aside of its normal.
std::optional<ExpectedView> Expect(const View& view, const Landmark& landmark);

// The keypoint as a measurement of the landmark from a camera that stands there. Seen from aside, a corner is not quite
// where it was:
//
//   sigma(a)^2 = sigma^2 + (level_scale AsideSigmaPxPerRad a)^2      a: the angle between the line of sight and the
//                                                                    landmark's mean one, as a chord
PixelObservation SeenAt(const FeatureFrame& features, int32_t keypoint, const Landmark& landmark,
                        const Eigen::Vector3d& camera_in_world);

// By how much the image turns about the optical axis from one camera to another, in 1/256 turn.
uint8_t RollBetween(const Rigid3& second_from_first);

}  // namespace tessera
