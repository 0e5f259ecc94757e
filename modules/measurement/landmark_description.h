// What follows from a landmark's position and observations, and helps to find it again.
#pragma once

#include "map/map.h"

namespace tessera {

// The landmark with normal, distance range and descriptor computed anew from its present observations (at least one):
//
//   normal = normalized mean over observations of (camera_in_world - position) / |camera_in_world - position|
//   depth_sigma = (sum over observations of |d(pixel)/d(position) normal|^2 / sigma_px^2)^-1/2,   at most
//     kMaxDepthShare d; at least d / 2 where two views without a depth of their own are all there is
//   max_distance = d * 1.2^level,  min_distance = max_distance / 1.2^kTopLevel
//
// with d and level from the newest keyframe that saw it: closer than min_distance or farther than max_distance its
// patch would fall off the pyramid. The descriptor is the observation's with the least median distance to the others
// (the medoid, as in ORB-SLAM: Mur-Artal et al. 2015); ties go to the older keyframe. To bound the work, at most the
// newest kMaxDescriptors observations count for it.
Landmark DescribeLandmark(const Map& map, LandmarkId id);
// The same for a landmark whose observations are those that its descriptor was chosen from: it keeps the descriptor,
// which is most of the work.
Landmark DescribeMovedLandmark(const Map& map, LandmarkId id);

inline constexpr int kMaxDescriptors = 12;

// Two views agree on a depth whatever they see, also where their keypoints only look alike: it takes a third one to
// confirm it. Until then the depth is known to this share of itself.
inline constexpr double kUnconfirmedShare = 0.5;

// A point that one keypoint shows, in the frame of its camera: normal, distance range and descriptor as above, but
// depth_sigma is left 0, for the caller to say.
Landmark DescribeInCamera(const FeatureFrame& features, int32_t keypoint, const Eigen::Vector3d& point_in_camera);

// What one observation says about the landmark's position along its normal, the camera's pose taken as exact: the
// inverse of a variance, 1 / m^2 (mono: in units of the map). 0 where the landmark stands behind the camera.
double DepthInformation(const FeatureFrame& features, int32_t keypoint, const Rigid3& world_from_camera,
                        const Landmark& landmark);
// The standard deviation that all information together leaves, never more than kMaxDepthShare of the distance. More
// than the distance itself: of the inverse depth no more is known than that it is between zero and a multiple of its
// value.
inline constexpr double kMaxDepthShare = 100.0;
double DepthSigma(double information, double distance);

// Whether more is known of its distance from this camera than that it may be any: of far points whose parallax drowns
// in noise it isn't.
bool HasDepth(const Landmark& landmark, const Eigen::Vector3d& camera_in_world);

// The landmark of a keyframe's frame and units in the world's.
Landmark InWorld(const Sim3& world_from_keyframe, Landmark point_in_keyframe);

}  // namespace tessera
