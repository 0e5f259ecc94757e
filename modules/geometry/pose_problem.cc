#include "geometry/pose_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

// A nearer point than a fifth of its estimated distance is out of reach of a depth correction.
constexpr double kMinInverseRatio = 0.2;

using Four = double __attribute__((vector_size(32)));

Four SquareRoot(const Four& value) {
  return Four{std::sqrt(value[0]), std::sqrt(value[1]), std::sqrt(value[2]), std::sqrt(value[3])};
}

double Sum(const Four& value) { return (value[0] + value[1]) + (value[2] + value[3]); }

Four Dot(const Four (&a)[3], const Four (&b)[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void Rotate(const Eigen::Matrix3d& rotation, const Four (&vector)[3], Four (&rotated)[3]) {
  for (int i = 0; i < 3; ++i) {
    rotated[i] = rotation(i, 0) * vector[0] + rotation(i, 1) * vector[1] + rotation(i, 2) * vector[2];
  }
}

// `u` moved where `is_moved`, but not out of reach.
Four Moved(const Four& u, const Four& step, const Four& relative_sigma, const Four& is_moved) {
  const Four least = (kMinInverseRatio - 1.0) / relative_sigma;  // -inf of an exact point
  const Four moved = u + step;
  return is_moved * relative_sigma > 0.0 ? (moved < least ? least : moved) : u;
}

}  // namespace

// Sums over points p_i, of Retract's tangent: d(point)/d(delta) = M = [I, -[p]x], so that a point's information W and
// gradient g add
//
//   M'W M = | W       -W [p]x     |      M'g = | g     |
//           | [p]x W  -[p]x W [p]x|            | p x g |
struct PoseProblem::NormalEquations {
  Four translation[6] = {};  // xx xy xz yy yz zz
  Four coupling[9] = {};     // rotation by translation, row by row
  Four rotation[6] = {};
  Four gradient[6] = {};
  Four num = {};

  void Add(const Four (&w)[6], const Four (&g)[3], const Four (&p)[3]) {
    const auto& [x, y, z] = p;
    const Four crossed[9] = {y * w[2] - z * w[1], y * w[4] - z * w[3], y * w[5] - z * w[4],   // [p]x W
                             z * w[0] - x * w[2], z * w[1] - x * w[4], z * w[2] - x * w[5],   //
                             x * w[1] - y * w[0], x * w[3] - y * w[1], x * w[4] - y * w[2]};  //
    for (int k = 0; k < 6; ++k) translation[k] += w[k];
    for (int k = 0; k < 9; ++k) coupling[k] += crossed[k];
    rotation[0] += y * crossed[2] - z * crossed[1];
    rotation[1] += z * crossed[0] - x * crossed[2];
    rotation[2] += x * crossed[1] - y * crossed[0];
    rotation[3] += z * crossed[3] - x * crossed[5];
    rotation[4] += x * crossed[4] - y * crossed[3];
    rotation[5] += x * crossed[7] - y * crossed[6];
    for (int k = 0; k < 3; ++k) gradient[k] += g[k];
    gradient[3] += y * g[2] - z * g[1];
    gradient[4] += z * g[0] - x * g[2];
    gradient[5] += x * g[1] - y * g[0];
  }

  Matrix6d Information() const {
    Matrix6d information;
    constexpr int kPlace[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        information(i, j) = Sum(translation[kPlace[i][j]]);
        information(i + 3, j + 3) = Sum(rotation[kPlace[i][j]]);
        information(i + 3, j) = information(j, i + 3) = Sum(coupling[3 * i + j]);
      }
    }
    return information;
  }
  Vector6d Gradient() const {
    Vector6d sum;
    for (int k = 0; k < 6; ++k) sum[k] = Sum(gradient[k]);
    return sum;
  }
};

PoseProblem::PoseProblem(const CameraCalibration& calibration, double baseline_m,
                         std::span<const PoseObservation> observations, const Rigid3& camera_from_world,
                         const PosePrior* prior)
    : prior_(prior),
      calibration_(calibration),
      baseline_m_(baseline_m),
      lane_of_(observations.size()),
      packs_((observations.size() + kLanes - 1) / kLanes),
      eliminated_(packs_.size()) {
  const Eigen::Vector3d camera_in_world = camera_from_world.Inverse().translation;
  for (Pack& pack : packs_) pack.chi2_limit -= 1.0;
  size_t next_lane = 0;
  for (const bool votes : {true, false}) {
    for (size_t i = 0; i < observations.size(); ++i) {
      if (observations[i].votes != votes) continue;
      lane_of_[i] = next_lane++;
      SetLane(packs_[lane_of_[i] / kLanes], lane_of_[i] % kLanes, observations[i], camera_in_world);
    }
    if (votes) num_voting_packs_ = (next_lane + kLanes - 1) / kLanes;
  }
}

void PoseProblem::SetLane(Pack& pack, size_t lane, const PoseObservation& observation,
                          const Eigen::Vector3d& camera_in_world) {
  const PixelObservation& seen = observation.seen;
  for (int k = 0; k < 3; ++k) {
    pack.point[k][lane] = observation.point_in_world[k];
    pack.depth_sigma[k][lane] = observation.depth_sigma_in_world[k];
  }
  pack.pixel_x[lane] = seen.pixel_px.x();
  pack.pixel_y[lane] = seen.pixel_px.y();
  pack.weight[lane] = 1.0 / seen.sigma_px;
  if (seen.has_right()) {
    const bool is_measured = seen.disparity_sigma_px > 0.0;
    pack.right_x[lane] = seen.right_x_px;
    pack.right_weight[lane] = 1.0 / (is_measured ? seen.disparity_sigma_px : seen.sigma_px);
    pack.is_column[lane] = is_measured ? 0.0 : 1.0;
  }
  pack.chi2_limit[lane] = Chi2Limit(seen.has_right());
  pack.freedom[lane] = seen.has_right() ? 3.0 : 2.0;
  pack.relative_sigma[lane] =
      observation.depth_sigma_in_world.norm() / (observation.point_in_world - camera_in_world).norm();
  pack.is_inlier[lane] = 1.0;
  pack.votes[lane] = observation.votes ? 1.0 : 0.0;
}

// As Reproject does it, of
//
//   point = R (point_i + depth_sigma_i u / (1 + u s)) + t,     d(point)/du = R depth_sigma_i / (1 + u s)^2
PoseProblem::Linearization PoseProblem::Linearize(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                                                  const Pack& pack) const {
  Linearization linear;
  const Four stretch = 1.0 + pack.u * pack.relative_sigma, shift = pack.u / stretch;
  Four in_world[3], by_u[3];
  for (int k = 0; k < 3; ++k) in_world[k] = pack.point[k] + shift * pack.depth_sigma[k];
  Rotate(rotation, in_world, linear.point);
  Rotate(rotation, pack.depth_sigma, by_u);
  for (int k = 0; k < 3; ++k) {
    linear.point[k] += translation[k];
    by_u[k] /= stretch * stretch;
  }
  const Four ones = Four{} + 1.0;
  linear.is_active = linear.point[2] < kMinDepth ? Four{} : ones;
  const Four inverse_z = 1.0 / (linear.point[2] < kMinDepth ? ones : linear.point[2]);
  const Four x = linear.point[0] * inverse_z, y = linear.point[1] * inverse_z;
  const Four column = calibration_.fx_px * x + calibration_.cx_px;
  const Four disparity = calibration_.fx_px * baseline_m_ * inverse_z;
  linear.residual[0] = pack.weight * (column - pack.pixel_x);
  linear.residual[1] = pack.weight * (calibration_.fy_px * y + calibration_.cy_px - pack.pixel_y);
  linear.residual[2] = pack.right_weight * ((pack.is_column > 0.0 ? column : pack.pixel_x) - disparity - pack.right_x);
  linear.x_x = calibration_.fx_px * inverse_z * pack.weight;
  linear.x_z = -linear.x_x * x;
  linear.y_y = calibration_.fy_px * inverse_z * pack.weight;
  linear.y_z = -linear.y_y * y;
  const Four per_z = calibration_.fx_px * inverse_z * pack.right_weight;
  linear.r_x = pack.is_column * per_z;
  linear.r_z = per_z * (baseline_m_ * inverse_z - pack.is_column * x);
  linear.by_u[0] = linear.x_x * by_u[0] + linear.x_z * by_u[2];
  linear.by_u[1] = linear.y_y * by_u[1] + linear.y_z * by_u[2];
  linear.by_u[2] = linear.r_x * by_u[0] + linear.r_z * by_u[2];
  return linear;
}

// With J = d(residual)/d(point) and d = d(residual)/du, what is left when u is eliminated, times the weights:
//
//   W = J'J - a a' / curvature,   g = J'r - a gradient / curvature,     a = J'd,  curvature = 1 + d'd,  gradient = d'r
//   + u
PoseProblem::Eliminated PoseProblem::Add(const Linearization& linear, const Pack& pack,
                                         NormalEquations& equations) const {
  const auto& [r_0, r_1, r_2] = linear.residual;
  const Four &x_x = linear.x_x, &x_z = linear.x_z, &y_y = linear.y_y, &y_z = linear.y_z;
  const Four &r_x = linear.r_x, &r_z = linear.r_z;
  Eliminated eliminated;
  for (int k = 0; k < 3; ++k) eliminated.point[k] = linear.point[k];
  eliminated.is_active = linear.is_active * pack.is_inlier * pack.votes;
  eliminated.curvature = 1.0 + Dot(linear.by_u, linear.by_u);
  eliminated.gradient = Dot(linear.by_u, linear.residual) + pack.u;
  Four(&a)[3] = eliminated.coupling;
  a[0] = x_x * linear.by_u[0] + r_x * linear.by_u[2];
  a[1] = y_y * linear.by_u[1];
  a[2] = x_z * linear.by_u[0] + y_z * linear.by_u[1] + r_z * linear.by_u[2];
  const Four inverse = 1.0 / eliminated.curvature, along = eliminated.gradient * inverse;
  Four w[6] = {x_x * x_x + r_x * r_x - a[0] * a[0] * inverse,
               -a[0] * a[1] * inverse,
               x_x * x_z + r_x * r_z - a[0] * a[2] * inverse,
               y_y * y_y - a[1] * a[1] * inverse,
               y_y * y_z - a[1] * a[2] * inverse,
               x_z * x_z + y_z * y_z + r_z * r_z - a[2] * a[2] * inverse};
  Four g[3] = {x_x * r_0 + r_x * r_2 - a[0] * along, y_y * r_1 - a[1] * along,
               x_z * r_0 + y_z * r_1 + r_z * r_2 - a[2] * along};

  const Four chi2 = Dot(linear.residual, linear.residual) + pack.u * pack.u;
  const Four ones = Four{} + 1.0;
  const Four huber = chi2 > pack.chi2_limit ? SquareRoot(pack.chi2_limit / chi2) : ones;
  // Its share of what the last step knew of the translation, a mean over the axes.
  const Eigen::Matrix3d& known = known_translation_;
  const Four leverage = huber / 3.0 *
                        (known(0, 0) * w[0] + known(1, 1) * w[3] + known(2, 2) * w[5] +
                         2.0 * (known(0, 1) * w[1] + known(0, 2) * w[2] + known(1, 2) * w[4]));
  const Four bound = leverage > max_leverage_ ? max_leverage_ / leverage : ones;
  const Four weight = eliminated.is_active > 0.0 ? huber * bound : Four{};
  for (Four& value : w) value *= weight;
  for (Four& value : g) value *= weight;
  equations.Add(w, g, eliminated.point);
  equations.num += eliminated.is_active;
  return eliminated;
}

std::optional<PoseProblem::Vector6d> PoseProblem::Step(const Rigid3& camera_from_world, Matrix6d* information) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  NormalEquations equations;
  for (size_t i = 0; i < num_voting_packs_; ++i) {
    eliminated_[i] = Add(Linearize(rotation, camera_from_world.translation, packs_[i]), packs_[i], equations);
  }
  *information = equations.Information();
  Vector6d gradient = equations.Gradient();
  known_translation_ = information->topLeftCorner<3, 3>().inverse();
  max_leverage_ = std::max(kMaxLeverage, 3.0 / Sum(equations.num));
  if (!known_translation_.allFinite()) return std::nullopt;
  if (prior_ != nullptr) {
    const Eigen::Vector3d center = (camera_from_world * prior_->camera_from_world.Inverse()).translation;
    information->topLeftCorner<3, 3>() += prior_->information;
    gradient.head<3>() += prior_->information * center;
  }
  const Vector6d step = information->ldlt().solve(-gradient);
  if (!step.allFinite()) return std::nullopt;
  // The point's motion is M step = translation + rotation x point.
  for (size_t i = 0; i < num_voting_packs_; ++i) {
    const Eliminated& e = eliminated_[i];
    const Four motion[3] = {step[0] + step[4] * e.point[2] - step[5] * e.point[1],
                            step[1] + step[5] * e.point[0] - step[3] * e.point[2],
                            step[2] + step[3] * e.point[1] - step[4] * e.point[0]};
    const Four of_u = -(e.gradient + Dot(e.coupling, motion)) / e.curvature;
    packs_[i].u = Moved(packs_[i].u, of_u, packs_[i].relative_sigma, e.is_active);
  }
  return step;
}

int PoseProblem::Classify(const Rigid3& camera_from_world) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  Four num = {}, sum = {};
  for (Pack& pack : packs_) {
    const Linearization before = Linearize(rotation, camera_from_world.translation, pack);
    const Four of_u = -(Dot(before.by_u, before.residual) + pack.u) / (1.0 + Dot(before.by_u, before.by_u));
    pack.u = Moved(pack.u, of_u, pack.relative_sigma, before.is_active);
    const Linearization at = Linearize(rotation, camera_from_world.translation, pack);
    const Four chi2 = Dot(at.residual, at.residual) + pack.u * pack.u;
    pack.is_inlier = chi2 > pack.chi2_limit ? Four{} : before.is_active * at.is_active;
    num += pack.is_inlier;
    sum += pack.is_inlier > 0.0 ? chi2 / pack.freedom : Four{};
  }
  const double num_inliers = Sum(num);
  rms_ = num_inliers > 0.0 ? std::sqrt(Sum(sum) / num_inliers) : 0.0;
  return static_cast<int>(num_inliers);
}

std::vector<char> PoseProblem::is_inlier() const {
  std::vector<char> is_inlier(lane_of_.size());
  for (size_t i = 0; i < is_inlier.size(); ++i) {
    is_inlier[i] = packs_[lane_of_[i] / kLanes].is_inlier[lane_of_[i] % kLanes] > 0.0 ? 1 : 0;
  }
  return is_inlier;
}

}  // namespace tessera
