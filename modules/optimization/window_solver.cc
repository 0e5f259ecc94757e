#include "optimization/window_solver.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "optimization/bundle_costs.h"

namespace tessera {
namespace {

// As Ceres has them.
constexpr double kMinRadius = 1e-32;
constexpr double kMinDiagonal = 1e-6;  // of J'J where damping is scaled by it
constexpr double kMinRelativeDecrease = 1e-3;
constexpr double kMinModelDecrease = 1e-14;  // of the cost; below it rounding decides
constexpr double kMinInverseRatio = 0.1;     // a step moves a point to ten times its distance at most

double LossBehind(bool has_right, int num_rows) {
  return HuberLoss(num_rows * kBehindResidual * kBehindResidual, Chi2Limit(has_right));
}

template <class Vector>
Vector Damping(const Vector& diagonal, double radius) {
  return diagonal.cwiseMax(kMinDiagonal) / radius;
}

}  // namespace

WindowSolver::WindowSolver(const BundleProblem& problem, const BundleOptions& options)
    : problem_(problem), options_(options) {
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    state_.poses.push_back(problem.poses[i].camera_from_world);
    state_.rotations.push_back(state_.poses.back().rotation.toRotationMatrix());
    free_of_pose_.push_back(problem.poses[i].is_fixed ? -1 : static_cast<int>(pose_of_free_.size()));
    if (!problem.poses[i].is_fixed) pose_of_free_.push_back(i);
  }
  for (const BundlePoint& point : problem.points) state_.positions.push_back(point.position_in_world);
}

std::optional<BundleSummary> WindowSolver::Solve(const std::vector<char>& takes_part) {
  SelectTerms(takes_part);
  const bool is_empty = terms_.empty() && (problem_.constraints.empty() || pose_of_free_.empty());
  if (is_empty) return std::nullopt;
  BundleSummary summary;
  summary.initial_cost = summary.final_cost = Cost(state_);
  double radius = options_.initial_radius, shrink = 2.0;
  bool is_linearized = false;
  while (summary.num_iterations < options_.max_num_iterations && radius > kMinRadius) {
    if (!is_linearized) Linearize();
    is_linearized = true;
    ++summary.num_iterations;
    const std::optional<Step> step = SolveStep(radius);
    if (step && step->model_decrease <= kMinModelDecrease * summary.final_cost) break;  // at the minimum
    State next = step ? Moved(*step) : State{};
    const double cost = step ? Cost(next) : 0.0, decrease = summary.final_cost - cost;
    const double gain = step ? decrease / step->model_decrease : -1.0;
    if (!(gain > kMinRelativeDecrease)) {  // not a number, too
      radius /= shrink;
      shrink *= 2.0;
      continue;
    }
    const bool is_converged = decrease <= options_.function_tolerance * summary.final_cost;
    state_ = std::move(next);
    summary.final_cost = cost;
    if (is_converged) break;
    radius = std::min(kMaxRadius, radius / std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * gain - 1.0, 3)));
    shrink = 2.0;
    is_linearized = false;
  }
  return summary;
}

void WindowSolver::WriteBack(BundleResult& result) const {
  result.camera_from_world = state_.poses;
  result.positions_in_world = state_.positions;
}

void WindowSolver::SelectTerms(const std::vector<char>& takes_part) {
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

double WindowSolver::Cost(const State& state) const {
  double sum = 0.0;
  for (size_t point = 0; point < state.positions.size(); ++point) {
    for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
      const PixelObservation& seen = problem_.observations[terms_[k].observation].seen;
      const Eigen::Vector3d in_camera =
          state.rotations[terms_[k].pose] * state.positions[point] + state.poses[terms_[k].pose].translation;
      sum += in_camera.z() < kMinDepth
                 ? LossBehind(seen.has_right(), seen.has_right() ? 3 : 2)
                 : HuberLoss(
                       ReprojectionResidual(problem_.calibration, problem_.baseline_m, in_camera, seen).squaredNorm(),
                       Chi2Limit(seen.has_right()));
    }
  }
  for (const RelativePoseConstraint& c : problem_.constraints) {
    const RelativePoseTerm term(c);
    sum +=
        term.Residual(state.poses[static_cast<size_t>(c.from)], state.poses[static_cast<size_t>(c.to)]).squaredNorm();
  }
  return 0.5 * sum;
}

void WindowSolver::Linearize() {
  u_.assign(pose_of_free_.size(), Matrix6d::Zero());
  g_pose_.assign(pose_of_free_.size(), Vector6d::Zero());
  v_.assign(state_.positions.size(), Eigen::Matrix3d::Zero());
  g_point_.assign(state_.positions.size(), Eigen::Vector3d::Zero());
  w_.resize(terms_.size());
  for (size_t point = 0; point < state_.positions.size(); ++point) {
    for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
      const bool has_right = problem_.observations[terms_[k].observation].seen.has_right();
      has_right ? LinearizeTerm<3>(terms_[k], point, w_[k]) : LinearizeTerm<2>(terms_[k], point, w_[k]);
    }
  }
  LinearizeConstraints();
}

// d(point_in_camera): by the point, R; by the pose's left perturbation (v, w), [I, -[point_in_camera]x].
template <int kRows>
void WindowSolver::LinearizeTerm(const Term& term, size_t point, Matrix63d& w) {
  const PixelObservation& seen = problem_.observations[term.observation].seen;
  const Eigen::Matrix3d& rotation = state_.rotations[term.pose];
  const Eigen::Vector3d in_camera = rotation * state_.positions[point] + state_.poses[term.pose].translation;
  if (term.free_pose >= 0) w.setZero();
  if (in_camera.z() < kMinDepth) return;
  const Reprojection r = Reproject(problem_.calibration, problem_.baseline_m, in_camera, seen);
  const double weight = HuberWeight(r.residual.squaredNorm(), Chi2Limit(kRows == 3));
  const Eigen::Matrix<double, kRows, 3> by_camera = r.by_point.template topRows<kRows>();
  const Eigen::Matrix<double, kRows, 3> by_point = by_camera.lazyProduct(rotation);
  const Eigen::Matrix<double, kRows, 1> weighted = weight * r.residual.template head<kRows>();
  v_[point].noalias() += weight * by_point.transpose().lazyProduct(by_point);
  g_point_[point].noalias() += by_point.transpose().lazyProduct(weighted);
  if (term.free_pose < 0) return;
  Eigen::Matrix<double, 6, kRows> by_pose;  // transposed: row' * -[p]x = (p x row)'
  for (int i = 0; i < kRows; ++i) {
    const Eigen::Vector3d row = by_camera.row(i).transpose();
    by_pose.col(i).template head<3>() = row;
    by_pose.col(i).template tail<3>() = in_camera.cross(row);
  }
  const auto pose = static_cast<size_t>(term.free_pose);
  const Eigen::Matrix<double, 6, kRows> weighted_by_pose = weight * by_pose;
  u_[pose].noalias() += weighted_by_pose.lazyProduct(by_pose.transpose());
  g_pose_[pose].noalias() += by_pose.lazyProduct(weighted);
  w.noalias() = weighted_by_pose.lazyProduct(by_point);
}

void WindowSolver::LinearizeConstraints() {
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

void WindowSolver::Reduce(double radius) {
  const int num_poses = static_cast<int>(pose_of_free_.size());
  reduced_.assign(static_cast<size_t>(num_poses * (num_poses + 1) / 2), Matrix6d::Zero());
  reduced_gradient_ = g_pose_;
  v_inverse_.resize(v_.size());
  point_damping_.resize(v_.size());
  for (int i = 0; i < num_poses; ++i) {
    Matrix6d& block = ReducedBlock(i, i);
    block = u_[static_cast<size_t>(i)];
    block.diagonal() += Damping<Vector6d>(block.diagonal(), radius);
  }
  for (const ConstraintBlock& block : constraint_blocks_) ReducedBlock(block.row, block.column) += block.value;
  for (size_t point = 0; point < v_.size(); ++point) {
    const size_t begin = terms_of_point_[point], end = terms_of_point_[point + 1];
    if (begin == end) continue;
    point_damping_[point] = PointDamping(point, radius);
    v_inverse_[point] = (v_[point] + point_damping_[point]).inverse();
    for (size_t k = begin; k < end; ++k) {
      const int row = terms_[k].free_pose;
      if (row < 0) continue;
      const Matrix63d y = w_[k].lazyProduct(v_inverse_[point]);
      reduced_gradient_[static_cast<size_t>(row)].noalias() -= y.lazyProduct(g_point_[point]);
      for (size_t l = begin; l < end; ++l) {
        const int column = terms_[l].free_pose;
        if (column < 0 || column > row) continue;
        ReducedBlock(row, column).noalias() -= y.lazyProduct(w_[l].transpose());
      }
    }
  }
}

std::optional<WindowSolver::Step> WindowSolver::SolveStep(double radius) {
  Reduce(radius);
  const auto num_poses = static_cast<Eigen::Index>(pose_of_free_.size());
  Step step{std::vector<Vector6d>(pose_of_free_.size()), {}, 0.0};
  if (num_poses > 0) {
    Eigen::MatrixXd matrix(6 * num_poses, 6 * num_poses);
    Eigen::VectorXd gradient(6 * num_poses);
    for (Eigen::Index row = 0; row < num_poses; ++row) {
      gradient.segment<6>(6 * row) = reduced_gradient_[static_cast<size_t>(row)];
      for (Eigen::Index column = 0; column <= row; ++column) {
        matrix.block<6, 6>(6 * row, 6 * column) = ReducedBlock(static_cast<int>(row), static_cast<int>(column));
      }
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factors(matrix);  // in place, the lower triangle
    if (factors.info() != Eigen::Success) return std::nullopt;
    factors.solveInPlace(gradient);
    for (size_t i = 0; i < step.poses.size(); ++i) {
      step.poses[i] = -gradient.segment<6>(6 * static_cast<Eigen::Index>(i));
    }
  }
  // With (J'J + D) d = -g:  cost - |r + J d|^2 / 2 = (d' D d - d' g) / 2.
  for (size_t i = 0; i < step.poses.size(); ++i) {
    const Vector6d damping = Damping<Vector6d>(u_[i].diagonal(), radius);
    step.model_decrease += 0.5 * step.poses[i].dot(damping.cwiseProduct(step.poses[i]) - g_pose_[i]);
  }
  step.points.resize(v_.size(), Eigen::Vector3d::Zero());
  for (size_t i = 0; i < v_.size(); ++i) {
    if (terms_of_point_[i] == terms_of_point_[i + 1]) continue;
    step.points[i] = BackSubstitute(i, step.poses);
    step.model_decrease += 0.5 * step.points[i].dot(point_damping_[i] * step.points[i] - g_point_[i]);
  }
  return step;
}

// From the center of the oldest camera that sees it, in whatever order the observations are listed.
Eigen::Vector3d WindowSolver::RayTo(size_t point) const {
  const size_t pose = ray_pose_of_point_[point];
  return state_.positions[point] + state_.rotations[pose].transpose() * state_.poses[pose].translation;
}

// Along the ray and aside of it, since a far point is known a thousand times better aside: damping by the world's axes
// would hold its depth as firmly as its direction.
Eigen::Matrix3d WindowSolver::PointDamping(size_t point, double radius) const {
  const Eigen::Vector3d ray = RayTo(point).normalized();
  const double along = ray.dot(v_[point] * ray), aside = 0.5 * (v_[point].trace() - along);
  const double damped_along = std::max(along, kMinDiagonal), damped_aside = std::max(aside, kMinDiagonal);
  Eigen::Matrix3d damping = (damped_along - damped_aside) / radius * (ray * ray.transpose());
  damping.diagonal().array() += damped_aside / radius;
  return damping;
}

// Linear in direction and inverse depth: with d the part of the step along the ray (as a share of it) and a the rest,
//   center + ray  ->  center + (ray + a) / (1 - d)
Eigen::Vector3d WindowSolver::MovedPoint(size_t point, const Eigen::Vector3d& step) const {
  const Eigen::Vector3d ray = RayTo(point);
  const double along = ray.dot(step) / ray.squaredNorm();
  const Eigen::Vector3d aside = step - along * ray;
  return state_.positions[point] - ray + (ray + aside) / std::max(kMinInverseRatio, 1.0 - along);
}

// d_p = -(V + D_p)^-1 (g_p + W' d_c)
Eigen::Vector3d WindowSolver::BackSubstitute(size_t point, const std::vector<Vector6d>& poses) const {
  Eigen::Vector3d sum = g_point_[point];
  for (size_t k = terms_of_point_[point]; k < terms_of_point_[point + 1]; ++k) {
    if (terms_[k].free_pose >= 0) {
      sum.noalias() += w_[k].transpose().lazyProduct(poses[static_cast<size_t>(terms_[k].free_pose)]);
    }
  }
  return -(v_inverse_[point] * sum);
}

WindowSolver::State WindowSolver::Moved(const Step& step) const {
  State moved = state_;
  for (size_t i = 0; i < step.poses.size(); ++i) {
    Rigid3& pose = moved.poses[pose_of_free_[i]];
    if (step.poses[i].isZero(0.0)) continue;
    pose = MoveBy(pose, step.poses[i]);
    moved.rotations[pose_of_free_[i]] = pose.rotation.toRotationMatrix();
  }
  for (size_t i = 0; i < step.points.size(); ++i) {
    if (terms_of_point_[i] < terms_of_point_[i + 1]) moved.positions[i] = MovedPoint(i, step.points[i]);
  }
  return moved;
}

}  // namespace tessera
