// How far the pose of a frame may be from the truth, as its own residuals show it.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/body_state.h"
#include "map/map.h"
#include "matching/point_matching.h"

namespace tessera {

// Of delta in  world_from_camera * Exp(delta), (translation, rotation) in the camera's axes and units of the world,
// against the points that the frame sees:
//
//   covariance = H^-1 (sum over cells g of s_g s_g') H^-1 * G / (G - 6)
//   H = sum_i J_i' W_i J_i,   s_g = sum over points i in g of J_i' W_i r_i,   W_i = (I + D_i P_i D_i')^-1
//
// r_i: the whitened residual, J_i and D_i: its derivatives by pose and point; P_i: the point's own covariance
// (depth_sigma along its normal; across it, a keypoint's noise over the root of the number of observers). The residuals
// themselves say how noisy keypoints are, on whatever level and however wrong the points may be ("sandwich": H. White,
// Econometrica 1980), and cells of the image as wide as a patch count as one observation each, since one corner gives
// keypoints on several levels that err alike (K.-Y. Liang and S. Zeger, Biometrika 1986). G: cells that hold a point.
// nullopt: fewer than 12 do, or they leave the pose open.
std::optional<Matrix6d> PoseCovariance(const Map& map, const TrackedFrame& frame);

}  // namespace tessera
