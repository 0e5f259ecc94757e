// Two views of the same points: the matrices that relate them, and the camera motions that such a matrix allows.
// Points are rays with z = 1. The direction of a translation is all that two views tell: it has length 1.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "geometry/rigid3.h"

namespace tessera {

struct RayPair {
  Eigen::Vector3d first;   // ray in the first camera, z = 1
  Eigen::Vector3d second;  // ray in the second camera, z = 1
};

// E = [t]x R of second_from_first: second' E first = 0 for every pair.
Eigen::Matrix3d EssentialFromMotion(const Rigid3& second_from_first);

// Essential matrix of 8 or more pairs (eight-point algorithm: Longuet-Higgins 1981; Hartley 1997), with its two equal
// singular values enforced. nullopt if the pairs don't fix it.
std::optional<Eigen::Matrix3d> EssentialFromPairs(std::span<const RayPair> pairs);

// Homography H, second ~ H first, of 4 or more pairs (direct linear transform). nullopt if the pairs don't fix it.
std::optional<Eigen::Matrix3d> HomographyFromPairs(std::span<const RayPair> pairs);

// Signed distance (first order) of a pair from the nearest pair that E allows, in ray units (Sampson 1982):
//   s = (x2' E x1) / sqrt((E x1)_x^2 + (E x1)_y^2 + (E' x2)_x^2 + (E' x2)_y^2)
double SampsonDistance(const Eigen::Matrix3d& essential, const RayPair& pair);

// Squared distance |H x1 - x2|^2 in the second view, in ray units.
double TransferErrorSquared(const Eigen::Matrix3d& homography, const RayPair& pair);

// The four motions second_from_first that an essential matrix allows (Hartley & Zisserman, 9.6.2).
std::vector<Rigid3> MotionsFromEssential(const Eigen::Matrix3d& essential);

// The motions that a homography of a plane allows: four (Ma, Soatto, Kosecka & Sastry 2004, 5.3.3), none for a pure
// rotation.
std::vector<Rigid3> MotionsFromHomography(const Eigen::Matrix3d& homography);

// Where the second camera is expected from the first: along `way`, in the axes that a camera has halfway of the turn
// from the first to the second (so that a camera on a steady curve keeps the same one), whatever the turn is found to
// be.
struct DirectionPrior {
  Eigen::Vector3d way = Eigen::Vector3d::UnitZ();  // of any length
  double sigma_rad = 0.0;                          // of its direction, an axis

  // The direction of t of second_from_first for this turn.
  Eigen::Vector3d DirectionFor(const Eigen::Quaterniond& second_from_first) const;
};

struct RefinedMotion {
  Rigid3 second_from_first;
  // Inverse covariance of (rotation [rad], direction of t in its tangent plane [rad]), for errors of standard deviation
  // 1 ray unit: divide by their variance.
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Zero();
};

// Refines R and the direction of t of second_from_first by Gauss-Newton on the Huber-weighted Sampson distances, which
// to first order is the reprojection error minimized over all points as well. `corner` is Huber's, in ray units.
// `prior` (nullptr: none) takes part with its share of the information, `sigma` being the pairs' standard deviation in
// ray units: pairs that show a plane, or far points, hardly tell moving aside from turning.
RefinedMotion RefineMotion(std::span<const RayPair> pairs, const Rigid3& second_from_first, double corner,
                           const DirectionPrior* prior = nullptr, double sigma = 0.0);

// Standard deviation of the direction of translation in its worst direction, radians, for errors of `sigma` ray units;
// infinite if the pairs don't fix it.
double DirectionSigma(const RefinedMotion& motion, double sigma);

}  // namespace tessera
