// Finds the landmarks of the map in a frame whose pose is roughly known.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "tracking/frame_view.h"
#include "tracking/matching.h"
#include "tracking/odometry_map.h"

namespace tessera {

// What association needs of a landmark, in one place in memory.
struct LocalLandmark {
  LandmarkId id;
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double reach = 0.0;  // see OdometryLandmark
  Descriptor descriptor{};
};

LocalLandmark MakeLocalLandmark(LandmarkId id, const OdometryLandmark& landmark);

// Where and at what size a landmark would show.
struct Projection {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  double right_x_px = kNoColumn;
  int level = 0;
};

// nullopt if it is behind the camera, outside the image, seen from more than 60 degrees off its normal, or at a
// size outside the pyramid.
std::optional<Projection> ProjectLandmark(const LocalLandmark& landmark, const Rigid3& camera_from_world,
                                          const FrameView& frame);

struct AssociationOptions {
  double radius_px = 4.0;  // half the search window, times kLevelScale^level of the landmark
  MatchingOptions matching;
};

struct Associations {
  std::vector<Match> matches;     // first: index of the landmark; second: keypoint of the frame
  std::vector<char> is_expected;  // by landmark: it should be seen
};

// For each landmark the keypoint nearest in descriptor, within the window and one level of what is expected, and for
// stereo and RGB-D with a right column in the window too. A keypoint goes to one landmark only.
Associations AssociateByProjection(std::span<const LocalLandmark> landmarks, const Rigid3& camera_from_world,
                                   const FrameView& frame, const AssociationOptions& options);

}  // namespace tessera
