#include "optimization/schur_solver.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <set>

#include "optimization/block_product.h"
#include "optimization/bundle_costs.h"

namespace tessera {
namespace {

// As Ceres has them.
constexpr double kMinRadius = 1e-32;
constexpr double kMinDiagonal = 1e-6;  // of J'J where damping is scaled by it
constexpr double kUsualGrowth = 3.0;
constexpr double kMinRelativeDecrease = 1e-3;
constexpr double kMinModelDecrease = 1e-14;  // of the cost; below it rounding decides
// With slow modes (BundleOptions): radii that grow by more than Ceres' 3 after a step that the model foresaw; climbs.
constexpr double kGoodGain = 0.9, kFastGrowth = 10.0;
constexpr double kMaxClimb = 0.1;  // of the cost
constexpr double kMaxHeightRatio = 0.25;
constexpr int kNumPointIterations = 2;
constexpr double kMinInverseRatio = 0.1;  // a step moves a point to ten times its distance at most

double LossBehind(bool has_right, int num_rows) {
  return HuberLoss(num_rows * kBehindResidual * kBehindResidual, Chi2Limit(has_right));
}

template <class Vector>
Vector Damping(const Vector& diagonal, double radius) {
  return diagonal.cwiseMax(kMinDiagonal) / radius;
}

// Two axes aside of the ray, then its direction.
Eigen::Matrix3d AxesAbout(const Eigen::Vector3d& ray) {
  Eigen::Index least = 0;
  ray.cwiseAbs().minCoeff(&least);
  Eigen::Matrix3d axes;
  axes.col(2) = ray.normalized();
  axes.col(0) = axes.col(2).cross(Eigen::Vector3d::Unit(least)).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

// (V + diag(damping))^-1. Scaled to a unit diagonal: of a far point the entries differ by twelve digits, and an inverse
// as it stands would leave the reduced system indefinite.
Eigen::Matrix3d DampedInverse(const Eigen::Matrix3d& v, const Eigen::Vector3d& damping) {
  Eigen::Matrix3d damped = v;
  damped.diagonal() += damping;
  const Eigen::Vector3d scale = damped.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix3d scaled = scale.asDiagonal() * damped * scale.asDiagonal();
  return scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
}

// Along the ray and aside of it, since a far point is known a thousand times better aside: damping by the world's axes
// would hold its depth as firmly as its direction.
Eigen::Vector3d PointDamping(const Eigen::Matrix3d& v, double radius) {
  const double aside = 0.5 * (v(0, 0) + v(1, 1));
  return Damping<Eigen::Vector3d>({aside, aside, v(2, 2)}, radius);
}

// Linear in direction and inverse depth: with d the part of the step along the ray (as a share of it) and a the rest,
//   center + ray  ->  center + (ray + a) / (1 - d)
Eigen::Vector3d MovedAlong(const Eigen::Vector3d& position, const Eigen::Vector3d& ray, const Eigen::Matrix3d& axes,
                           const Eigen::Vector3d& step) {
  const Eigen::Vector3d aside = axes.leftCols<2>() * step.head<2>();
  return position - ray + (ray + aside) / std::max(kMinInverseRatio, 1.0 - step.z() / ray.norm());
}

}  // namespace

void TrustRegion::Accept(double gain, bool grows_fast) {
  const double growth = grows_fast && gain > kGoodGain ? kFastGrowth : kUsualGrowth;
  radius_ = std::min(kMaxRadius, radius_ / std::max(1.0 / growth, 1.0 - std::pow(2.0 * gain - 1.0, 3)));
  shrink_ = 2.0;
}

void TrustRegion::Reject() {
  radius_ /= shrink_;
  shrink_ *= 2.0;
}

SchurSolver::SchurSolver(const BundleProblem& problem, const BundleOptions& options)
    : problem_(problem), options_(options), region_(options.initial_radius) {
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    state_.poses.push_back(problem.poses[i].camera_from_world);
    state_.rotations.push_back(state_.poses.back().rotation.toRotationMatrix());
    free_of_pose_.push_back(problem.poses[i].is_fixed ? -1 : static_cast<int>(pose_of_free_.size()));
    if (!problem.poses[i].is_fixed) pose_of_free_.push_back(i);
  }
  for (const BundlePoint& point : problem.points) state_.positions.push_back(point.position_in_world);
}

std::optional<BundleSummary> SchurSolver::Solve(const std::vector<char>& takes_part, double function_tolerance) {
  SelectTerms(takes_part);
  const bool is_empty = terms_.empty() && (problem_.constraints.empty() || pose_of_free_.empty());
  if (is_empty) return std::nullopt;
  reduced_ = MakeReducedSystem();
  if (!options_.has_slow_modes) region_ = TrustRegion(options_.initial_radius);
  BundleSummary summary;
  summary.initial_cost = summary.final_cost = Cost(state_);
  bool is_linearized = false;
  std::optional<Climb> climb;
  while (summary.num_iterations < options_.max_num_iterations && region_.radius() > kMinRadius) {
    if (!is_linearized) Linearize();
    is_linearized = true;
    ++summary.num_iterations;
    const std::optional<Step> step = SolveStep(region_.radius());
    const bool is_flat = step && step->model_decrease <= kMinModelDecrease * summary.final_cost;
    if (is_flat && !climb) break;  // at the minimum
    State next = step ? Moved(*step) : State{};
    const double cost = step ? Cost(next) : 0.0, decrease = summary.final_cost - cost;
    const double gain = step ? decrease / (climb ? climb->model_decrease : step->model_decrease) : -1.0;
    if (gain > kMinRelativeDecrease) {
      state_ = std::move(next);
      climb.reset();
      summary.final_cost = cost;
      if (decrease <= function_tolerance * summary.final_cost) break;
      region_.Accept(gain, options_.has_slow_modes);
    } else if (step && MayClimb(-decrease, summary.final_cost, climb)) {
      if (!climb) climb = Climb{std::move(state_), step->model_decrease};
      climb->height = -decrease;
      state_ = std::move(next);
    } else {  // of a value that is not a number, too
      region_.Reject();
      if (!climb) continue;  // the same place again
      state_ = std::move(climb->from);
      climb.reset();
    }
    is_linearized = false;
  }
  if (climb) state_ = std::move(climb->from);
  return summary;
}

// A long step along a curved valley ends on its side, above where it began. The next step leads down again, since the
// sides are steep and so well known; the height must fall quickly.
bool SchurSolver::MayClimb(double height, double cost, const std::optional<Climb>& climb) const {
  return options_.has_slow_modes && height < (climb ? kMaxHeightRatio * climb->height : kMaxClimb * cost);
}

void SchurSolver::WriteBack(BundleResult& result) const {
  result.camera_from_world = state_.poses;
  result.positions_in_world = state_.positions;
}

void SchurSolver::SelectTerms(const std::vector<char>& takes_part) {
  // Counting sort by point.
  terms_of_point_.assign(problem_.points.size() + 1, 0);
  for (size_t i = 0; i < takes_part.size(); ++i) {
    if (takes_part[i]) ++terms_of_point_[static_cast<size_t>(problem_.observations[i].point) + 1];
  }
  for (size_t i = 1; i < terms_of_point_.size(); ++i) terms_of_point_[i] += terms_of_point_[i - 1];
  terms_.resize(terms_of_point_.back());
  std::vector<size_t> next = terms_of_point_;
  for (size_t i = 0; i < takes_part.size(); ++i) {
    if (!takes_part[i]) continue;
    const auto pose = static_cast<size_t>(problem_.observations[i].pose);
    terms_[next[static_cast<size_t>(problem_.observations[i].point)]++] = {i, pose, free_of_pose_[pose]};
  }
  ray_pose_of_point_.assign(problem_.points.size(), 0);
  for (size_t point = 0; point < ray_pose_of_point_.size(); ++point) {
    const auto begin = terms_.begin() + static_cast<ptrdiff_t>(terms_of_point_[point]);
    const auto end = terms_.begin() + static_cast<ptrdiff_t>(terms_of_point_[point + 1]);
    if (begin == end) continue;
    const auto is_older = [this](const Term& a, const Term& b) {
      return problem_.poses[a.pose].id < problem_.poses[b.pose].id;
    };
    ray_pose_of_point_[point] = std::min_element(begin, end, is_older)->pose;
  }
}

std::unique_ptr<ReducedSystem> SchurSolver::MakeReducedSystem() const {
  const auto num_poses = static_cast<int>(pose_of_free_.size());
  if (num_poses <= options_.max_num_dense_poses) return MakeDenseSystem(num_poses);
  std::set<ReducedSystem::Place> places;
  for (int i = 0; i < num_poses; ++i) places.insert({i, i});
  for (size_t point = 0; point < problem_.points.size(); ++point) {
    for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
      for (size_t l = terms_of_point_[point]; l < k; ++l) {
        const auto [column, row] = std::minmax(terms_[k].free_pose, terms_[l].free_pose);
        if (column >= 0) places.insert({row, column});
      }
    }
  }
  for (const RelativePoseConstraint& c : problem_.constraints) {
    const auto [column, row] =
        std::minmax(free_of_pose_[static_cast<size_t>(c.from)], free_of_pose_[static_cast<size_t>(c.to)]);
    if (column >= 0) places.insert({row, column});
  }
  return MakeSparseSystem(num_poses, std::vector(places.begin(), places.end()));
}

double SchurSolver::TwiceCostOf(size_t point, const State& state) const {
  double sum = 0.0;
  for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
    const PixelObservation& seen = problem_.observations[terms_[k].observation].seen;
    const Eigen::Vector3d in_camera =
        state.rotations[terms_[k].pose] * state.positions[point] + state.poses[terms_[k].pose].translation;
    sum +=
        in_camera.z() < kMinDepth
            ? LossBehind(seen.has_right(), seen.has_right() ? 3 : 2)
            : HuberLoss(SquaredNorm(ReprojectionResidual(problem_.calibration, problem_.baseline_m, in_camera, seen)),
                        Chi2Limit(seen.has_right()));
  }
  return sum;
}

double SchurSolver::Cost(const State& state) const {
  double sum = 0.0;
  for (size_t point = 0; point < state.positions.size(); ++point) sum += TwiceCostOf(point, state);
  for (const RelativePoseConstraint& c : problem_.constraints) {
    const RelativePoseTerm term(c);
    sum +=
        term.Residual(state.poses[static_cast<size_t>(c.from)], state.poses[static_cast<size_t>(c.to)]).squaredNorm();
  }
  return 0.5 * sum;
}

// Points follow the poses at once, by Gauss-Newton steps of their own (embedded point iterations: Y. Jeong, D. Nister,
// D. Steedly, R. Szeliski, I.-S. Kweon, "Pushing the Envelope of Modern Methods for Bundle Adjustment", T-PAMI 2012).
// What the poses gain is then not lost by points of which the linear step knew too little.
void SchurSolver::RefinePoints(State& state) const {
  for (size_t point = 0; point < state.positions.size(); ++point) {
    if (terms_of_point_[point] == terms_of_point_[point + 1]) continue;
    double cost = TwiceCostOf(point, state);
    for (int i = 0; i < kNumPointIterations; ++i) {
      const Eigen::Vector3d before = state.positions[point];
      state.positions[point] = RefinedPoint(point, state);
      const double refined = TwiceCostOf(point, state);
      if (!(refined < cost)) {
        state.positions[point] = before;
        break;
      }
      cost = refined;
    }
  }
}

void SchurSolver::Linearize() {
  u_.assign(pose_of_free_.size(), Matrix6d::Zero());
  g_pose_.assign(pose_of_free_.size(), Vector6d::Zero());
  v_.assign(state_.positions.size(), Eigen::Matrix3d::Zero());
  g_point_.assign(state_.positions.size(), Eigen::Vector3d::Zero());
  w_.resize(terms_.size());
  axes_.resize(state_.positions.size());
  for (size_t point = 0; point < state_.positions.size(); ++point) {
    if (terms_of_point_[point] < terms_of_point_[point + 1]) axes_[point] = AxesAbout(RayTo(point, state_));
    for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
      const bool has_right = problem_.observations[terms_[k].observation].seen.has_right();
      has_right ? LinearizeTerm<3>(terms_[k], point, w_[k]) : LinearizeTerm<2>(terms_[k], point, w_[k]);
    }
  }
  LinearizeConstraints();
}

// d(point_in_camera): by the point, R; by the pose's left perturbation (v, w), [I, -[point_in_camera]x].
template <int kRows>
void SchurSolver::LinearizeTerm(const Term& term, size_t point, Matrix63d& w) {
  const PixelObservation& seen = problem_.observations[term.observation].seen;
  const Eigen::Matrix3d& rotation = state_.rotations[term.pose];
  const Eigen::Vector3d in_camera = rotation * state_.positions[point] + state_.poses[term.pose].translation;
  if (term.free_pose >= 0) w.setZero();
  if (in_camera.z() < kMinDepth) return;
  const Reprojection r = Reproject(problem_.calibration, problem_.baseline_m, in_camera, seen);
  const double weight = HuberWeight(SquaredNorm(r.residual), Chi2Limit(kRows == 3));
  const Eigen::Matrix<double, kRows, 3> by_camera = r.by_point.template topRows<kRows>();
  const Eigen::Matrix3d axes_in_camera = rotation.lazyProduct(axes_[point]);
  const Eigen::Matrix<double, kRows, 3> by_point = by_camera.lazyProduct(axes_in_camera);
  const Eigen::Matrix<double, kRows, 1> weighted = weight * r.residual.template head<kRows>();
  v_[point].noalias() += weight * by_point.transpose().lazyProduct(by_point);
  g_point_[point].noalias() += by_point.transpose().lazyProduct(weighted);
  if (term.free_pose < 0) return;
  Eigen::Matrix<double, 6, kRows> by_pose, weighted_by_pose;  // transposed: row' * -[p]x = (p x row)'
  for (int i = 0; i < kRows; ++i) {
    const double x = by_camera(i, 0), y = by_camera(i, 1), z = by_camera(i, 2);
    const std::array<double, 6> column = {x,
                                          y,
                                          z,
                                          in_camera.y() * z - in_camera.z() * y,
                                          in_camera.z() * x - in_camera.x() * z,
                                          in_camera.x() * y - in_camera.y() * x};
    for (int j = 0; j < 6; ++j) {
      by_pose(j, i) = column[Index(j)];
      weighted_by_pose(j, i) = weight * column[Index(j)];
    }
  }
  const auto pose = static_cast<size_t>(term.free_pose);
  AddProduct<1>(weighted_by_pose, by_pose, u_[pose]);
  g_pose_[pose].noalias() += by_pose.lazyProduct(weighted);
  w.noalias() = weighted_by_pose.lazyProduct(by_point);
}

void SchurSolver::LinearizeConstraints() {
  constraint_blocks_.clear();
  for (const RelativePoseConstraint& c : problem_.constraints) {
    const auto from = static_cast<size_t>(c.from), to = static_cast<size_t>(c.to);
    const RelativePoseTerm::Linear linear = RelativePoseTerm(c).Linearize(state_.poses[from], state_.poses[to]);
    const auto add = [&](int pose, const Matrix6d& by_pose) {
      if (pose < 0) return;
      u_[static_cast<size_t>(pose)].noalias() += by_pose.transpose() * by_pose;
      g_pose_[static_cast<size_t>(pose)].noalias() += by_pose.transpose() * linear.residual;
    };
    const int free_from = free_of_pose_[from], free_to = free_of_pose_[to];
    add(free_from, linear.by_from);
    add(free_to, linear.by_to);
    if (free_from < 0 || free_to < 0) continue;
    if (free_from > free_to) {
      constraint_blocks_.push_back({free_from, free_to, linear.by_from.transpose() * linear.by_to});
    } else {
      constraint_blocks_.push_back({free_to, free_from, linear.by_to.transpose() * linear.by_from});
    }
  }
}

void SchurSolver::Reduce(double radius) {
  const int num_poses = static_cast<int>(pose_of_free_.size());
  reduced_->Clear();
  reduced_gradient_ = g_pose_;
  v_inverse_.resize(v_.size());
  point_damping_.resize(v_.size());
  for (int i = 0; i < num_poses; ++i) {
    Matrix6d& block = reduced_->At(i, i);
    block = u_[static_cast<size_t>(i)];
    block.diagonal() += Damping<Vector6d>(block.diagonal(), radius);
  }
  for (const ConstraintBlock& block : constraint_blocks_) reduced_->At(block.row, block.column) += block.value;
  for (size_t point = 0; point < v_.size(); ++point) {
    const size_t begin = terms_of_point_[point], end = terms_of_point_[point + 1];
    if (begin == end) continue;
    point_damping_[point] = PointDamping(v_[point], radius);
    v_inverse_[point] = DampedInverse(v_[point], point_damping_[point]);
    for (size_t k = begin; k < end; ++k) {
      const int row = terms_[k].free_pose;
      if (row < 0) continue;
      const Matrix63d y = w_[k].lazyProduct(v_inverse_[point]);
      reduced_gradient_[static_cast<size_t>(row)].noalias() -= y.lazyProduct(g_point_[point]);
      for (size_t l = begin; l < end; ++l) {
        const int column = terms_[l].free_pose;
        if (column < 0 || column > row) continue;
        AddProduct<-1>(y, w_[l], reduced_->At(row, column));
      }
    }
  }
}

std::optional<SchurSolver::Step> SchurSolver::SolveStep(double radius) {
  Reduce(radius);
  Step step{reduced_gradient_, {}, 0.0};
  if (!step.poses.empty() && !reduced_->Solve(step.poses)) return std::nullopt;
  for (Vector6d& pose : step.poses) pose = -pose;
  // With (J'J + D) d = -g:  cost - |r + J d|^2 / 2 = (d' D d - d' g) / 2.
  for (size_t i = 0; i < step.poses.size(); ++i) {
    const Vector6d damping = Damping<Vector6d>(u_[i].diagonal(), radius);
    step.model_decrease += 0.5 * step.poses[i].dot(damping.cwiseProduct(step.poses[i]) - g_pose_[i]);
  }
  step.points.resize(v_.size(), Eigen::Vector3d::Zero());
  for (size_t i = 0; i < v_.size(); ++i) {
    if (terms_of_point_[i] == terms_of_point_[i + 1]) continue;
    step.points[i] = BackSubstitute(i, step.poses);
    step.model_decrease += 0.5 * step.points[i].dot(point_damping_[i].cwiseProduct(step.points[i]) - g_point_[i]);
  }
  return step;
}

// From the center of the oldest camera that sees it, in whatever order the observations are listed.
Eigen::Vector3d SchurSolver::RayTo(size_t point, const State& state) const {
  const size_t pose = ray_pose_of_point_[point];
  return state.positions[point] + state.rotations[pose].transpose() * state.poses[pose].translation;
}

Eigen::Vector3d SchurSolver::RefinedPoint(size_t point, const State& state) const {
  const Eigen::Vector3d ray = RayTo(point, state);
  const Eigen::Matrix3d axes = AxesAbout(ray);
  Eigen::Matrix3d v = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
    const PixelObservation& seen = problem_.observations[terms_[k].observation].seen;
    const Eigen::Matrix3d& rotation = state.rotations[terms_[k].pose];
    const Eigen::Vector3d in_camera = rotation * state.positions[point] + state.poses[terms_[k].pose].translation;
    if (in_camera.z() < kMinDepth) continue;
    const Reprojection r = Reproject(problem_.calibration, problem_.baseline_m, in_camera, seen);
    const double weight = HuberWeight(SquaredNorm(r.residual), Chi2Limit(seen.has_right()));
    const Eigen::Matrix3d axes_in_camera = rotation.lazyProduct(axes);
    const Eigen::Matrix3d by_point = r.by_point.lazyProduct(axes_in_camera);
    v.noalias() += weight * by_point.transpose().lazyProduct(by_point);
    g.noalias() += weight * by_point.transpose().lazyProduct(r.residual);
  }
  const Eigen::Vector3d step = -(DampedInverse(v, PointDamping(v, kMaxRadius)) * g);
  return MovedAlong(state.positions[point], ray, axes, step);
}

// d_p = -(V + D_p)^-1 (g_p + W' d_c)
Eigen::Vector3d SchurSolver::BackSubstitute(size_t point, const std::vector<Vector6d>& poses) const {
  Eigen::Vector3d sum = g_point_[point];
  for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
    if (terms_[k].free_pose >= 0) {
      sum.noalias() += w_[k].transpose().lazyProduct(poses[static_cast<size_t>(terms_[k].free_pose)]);
    }
  }
  return -(v_inverse_[point] * sum);
}

SchurSolver::State SchurSolver::Moved(const Step& step) const {
  State moved = state_;
  for (size_t i = 0; i < step.poses.size(); ++i) {
    Rigid3& pose = moved.poses[pose_of_free_[i]];
    if (step.poses[i].isZero(0.0)) continue;
    pose = MoveBy(pose, step.poses[i]);
    moved.rotations[pose_of_free_[i]] = pose.rotation.toRotationMatrix();
  }
  for (size_t i = 0; i < step.points.size(); ++i) {
    if (terms_of_point_[i] == terms_of_point_[i + 1]) continue;
    moved.positions[i] = MovedAlong(state_.positions[i], RayTo(i, state_), axes_[i], step.points[i]);
  }
  if (options_.has_slow_modes) RefinePoints(moved);
  return moved;
}

}  // namespace tessera
