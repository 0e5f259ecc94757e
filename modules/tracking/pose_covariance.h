// How far the pose of a frame may be from the truth, as its own residuals show it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "geometry/body_state.h"
#include "matching/point_matching.h"

namespace tessera {

// What the error of one point that a frame sees, and of where it sees it, does to the frame's pose.
struct PointInfluence {
  PointId point;                         // invalid: another one than any other frame sees
  int cell = 0;                          // of the image
  Eigen::Matrix<double, 6, 1> moves_by;  // delta in  true pose = world_from_camera * Exp(delta)
};

// Of delta in  world_from_camera * Exp(delta), (translation, rotation) in the camera's axes and units of the world,
// against the points that the frame sees. To first order, point i moves the pose by
//
//   d_i = -H^-1 J_i' W_i r_i * sqrt(G / (G - 6)) / K,   H = sum_i J_i' W_i J_i,   W_i = (I + D_i P_i D_i')^-1
//
// r_i: the whitened residual, J_i and D_i: its derivatives by pose and point; P_i: the point's covariance, depth_sigma
// along its normal; G: cells of the image, as wide as a patch, that hold a point; K: see KeptVariance. W_i and the
// bound on its leverage are those of pose optimization, whose error this is. nullopt: fewer than 12 cells do, or they
// leave the pose open.
using PoseInfluences = std::vector<PointInfluence>;
std::optional<PoseInfluences> InfluencesOn(const TrackedFrame& frame);

// Points whose squared error is beyond a limit were taken out as outliers, and with them the tail of the noise. So the
// rest varies less than the noise does: by a factor K. And it holds the pose less than it seems to, since a pose that
// moves finds other points within the limit: by K again. The pose's covariance is 1 / K^2 of what residuals show (the
// asymptotic variance of a skipped mean: P. Huber, "Robust Statistics", 1981). Of Gaussian noise of variance
// v in k dimensions, with t = limit / 2 v:
//
//   K = 1 - 1 / S(t),   S(t) = sum_j t^j / ((k/2 + 1) ... (k/2 + j)),   mean squared error = k v K
//
// `mean_share`: the mean squared error by the limit, which tells v; `freedom`: k. t counts as at least 1: with more
// noise (in two dimensions, more than a third of it beyond the limit) what is left looks the same.
double KeptVariance(double mean_share, double freedom);

// The residuals themselves say how noisy keypoints are, on whatever level and however wrong the points may be
// ("sandwich": H. White, Econometrica 1980), and each cell counts as one observation, since one corner gives keypoints
// on several levels that err alike (K.-Y. Liang and S. Zeger, Biometrika 1986):
//
//   covariance = sum over cells g of (sum_i in g of d_i) (...)'
Matrix6d PoseCovariance(const PoseInfluences& influences);

// The same of the way between two frames, of which both poses err: delta in  reference_from_frame * Exp(delta). What
// both have from a point that both see is one error, of which the way has the difference:
//
//   d_i = d_i (frame) - Ad d_i (reference),   Ad: of frame_from_reference
//
// `reference` must be sorted by point.
Matrix6d WayCovariance(const PoseInfluences& reference, const PoseInfluences& frame,
                       const Rigid3& frame_from_reference);

// d' covariance^-1 d by degrees of freedom: 6; or 5, at its least, where d is free along a translation.
double ErrorByCovariance(const Eigen::Matrix<double, 6, 1>& d, const Matrix6d& covariance,
                         const std::optional<Eigen::Vector3d>& free_direction);

}  // namespace tessera
