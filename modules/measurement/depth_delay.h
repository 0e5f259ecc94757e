// A depth camera that isn't triggered together with the color camera, such as a Kinect's, measures a little before or
// after the image is taken. A camera that turns has moved by pixels meanwhile: its keypoints have depths of the surface
// beside them.
//
// Around a keypoint, the surface is taken to be a plane, a . point = 1. At ray r = (x, y, 1) its inverse depth is a .
// r, so that the depths of the keypoints around it give a. With point_in_image = R point_in_depth + t,
//
//   a_in_image . (R point_in_depth + t) = 1    =>    a_in_depth = R^T a_in_image / (1 - a_in_image . t)
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "measurement/frame_view.h"
#include "measurement/rolling_shutter.h"

namespace tessera {

// The plane a (1/m) that the depths around a keypoint with depth show, in the camera frame, through the depth of its
// own. nullopt: too few near it lie on one surface with it.
std::optional<Eigen::Vector3d> SurfaceAt(const FrameView& view, int keypoint);

// a in another frame, from a . point_in_here = 1.
Eigen::Vector3d SurfaceIn(const Rigid3& here_from_there, const Eigen::Vector3d& surface_here);

// How the inverse depth at a fixed ray changes while the camera moves so, 1/m/s.
double InverseDepthRate(const Eigen::Vector3d& surface, const Eigen::Vector3d& ray, const CameraMotion& motion);

// By keypoint: SurfaceAt().
using DepthSurfaces = std::vector<std::optional<Eigen::Vector3d>>;
DepthSurfaces SurfacesOf(const FrameView& view);

// The features of the view whose surfaces these are, with the depths that would have been measured when the image was
// taken, `delay_s` before they were (< 0: after). A keypoint whose depth can't be told any more has none then.
FeatureFrame WithDepthsOfImage(const FrameView& view, const DepthSurfaces& surfaces, double delay_s,
                               const CameraMotion& motion);

}  // namespace tessera
