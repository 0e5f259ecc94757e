#include "optimization/pose_graph.h"

#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "optimization/ceres_options.h"
#include "optimization/pose_graph_costs.h"

namespace tessera {
namespace {

bool IsFinite(const Sim3& pose) {
  return std::isfinite(pose.scale) && pose.rotation.coeffs().allFinite() && pose.translation.allFinite();
}

bool IsFinite(const PoseGraphProblem& problem) {
  return std::all_of(problem.nodes.begin(), problem.nodes.end(),
                     [](const PoseGraphNode& node) { return IsFinite(node.world_from_keyframe); }) &&
         std::all_of(problem.edges.begin(), problem.edges.end(), [](const PoseGraphEdge& edge) {
           return IsFinite(edge.to_from_from) && edge.covariance.allFinite();
         });
}

// Nodes that a chain of edges connects with a fixed one: all others could drift away together.
std::vector<char> ConnectedToFixed(const PoseGraphProblem& problem) {
  std::vector<std::vector<size_t>> neighbors(problem.nodes.size());
  for (const PoseGraphEdge& edge : problem.edges) {
    neighbors[static_cast<size_t>(edge.from)].push_back(static_cast<size_t>(edge.to));
    neighbors[static_cast<size_t>(edge.to)].push_back(static_cast<size_t>(edge.from));
  }
  std::vector<char> is_connected(problem.nodes.size(), 0);
  std::vector<size_t> to_visit;
  for (size_t i = 0; i < problem.nodes.size(); ++i) {
    if (problem.nodes[i].is_fixed) {
      is_connected[i] = 1;
      to_visit.push_back(i);
    }
  }
  while (!to_visit.empty()) {
    const size_t node = to_visit.back();
    to_visit.pop_back();
    for (const size_t neighbor : neighbors[node]) {
      if (!is_connected[neighbor]) {
        is_connected[neighbor] = 1;
        to_visit.push_back(neighbor);
      }
    }
  }
  return is_connected;
}

ceres::Solver::Options SolverOptions(const PoseGraphOptions& options) {
  ceres::Solver::Options solver = CeresSolverOptions(options.max_num_iterations, options.function_tolerance);
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // These two depend on the unit of the map.
  solver.gradient_tolerance = 0.0;
  solver.parameter_tolerance = 0.0;
  // The first steps are Gauss-Newton's. The error of a loop is spread by the slowest modes of a chain, whose curvature
  // is (length of the chain)^-2 of the diagonal: with Ceres' 1e4 damping would hold them for many steps, and 20
  // iterations end long before the minimum.
  solver.initial_trust_region_radius = 1e16;
  return solver;
}

// One solve. Tangents lie in one array in the problem's order, so that no order of addresses can matter.
template <int kSize>
class PoseGraphSolver {
 public:
  PoseGraphSolver(const PoseGraphProblem& problem, const PoseGraphOptions& options)
      : problem_(problem),
        options_(options),
        is_connected_(ConnectedToFixed(problem)),
        tangents_(kSize * problem.nodes.size(), 0.0) {
    for (size_t i = 0; i < problem.nodes.size(); ++i) {
      MovingNode node;
      node.base = problem.nodes[i].world_from_keyframe;
      node.tangent = Tangent(i);
      node.has_scale = kSize == 7;
      node.Update();
      nodes_.push_back(node);
    }
  }

  std::optional<std::vector<Sim3>> Solve() {
    NodeUpdater updater(nodes_);
    ceres::Problem ceres_problem(CeresProblemOptions(updater));
    if (!AddNodes(ceres_problem)) return std::nullopt;
    AddEdges(ceres_problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(options_), &ceres_problem, &summary);
    if (!summary.IsSolutionUsable()) return std::nullopt;
    return Solution();
  }

 private:
  double* Tangent(size_t node) { return tangents_.data() + kSize * node; }
  bool IsFree(size_t node) const { return is_connected_[node] && !problem_.nodes[node].is_fixed; }

  // False if none is free.
  bool AddNodes(ceres::Problem& ceres_problem) {
    bool is_any_free = false;
    for (size_t i = 0; i < nodes_.size(); ++i) {
      if (!is_connected_[i]) continue;
      ceres_problem.AddParameterBlock(Tangent(i), kSize);
      if (problem_.nodes[i].is_fixed) ceres_problem.SetParameterBlockConstant(Tangent(i));
      is_any_free = is_any_free || IsFree(i);
    }
    return is_any_free;
  }

  void AddEdges(ceres::Problem& ceres_problem) {
    for (const PoseGraphEdge& edge : problem_.edges) {
      const auto from = static_cast<size_t>(edge.from), to = static_cast<size_t>(edge.to);
      if (!is_connected_[from]) continue;
      costs_.push_back(std::make_unique<PoseGraphCost<kSize>>(edge, options_, nodes_[from], nodes_[to]));
      ceres_problem.AddResidualBlock(costs_.back().get(), nullptr, Tangent(from), Tangent(to));
    }
  }

  std::optional<std::vector<Sim3>> Solution() {
    std::vector<Sim3> result;
    for (size_t i = 0; i < nodes_.size(); ++i) {
      nodes_[i].Update();
      result.push_back(IsFree(i) ? nodes_[i].world_from_keyframe : nodes_[i].base);
      if (!IsFinite(result.back()) || !(result.back().scale > 0.0)) return std::nullopt;
    }
    return result;
  }

  const PoseGraphProblem& problem_;
  const PoseGraphOptions& options_;
  const std::vector<char> is_connected_;
  std::vector<double> tangents_;
  std::vector<MovingNode> nodes_;
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
};

template <int kSize>
double CostAt(const std::vector<Sim3>& world_from_keyframe, const PoseGraphProblem& problem,
              const PoseGraphOptions& options) {
  const std::array<double, kSize> unmoved{};
  const std::array<const double*, 2> tangents{unmoved.data(), unmoved.data()};
  const auto node_at = [&](int index) {
    MovingNode node;
    node.base = world_from_keyframe[static_cast<size_t>(index)];
    node.tangent = unmoved.data();
    node.has_scale = kSize == 7;
    node.Update();
    return node;
  };
  double sum = 0.0;
  for (const PoseGraphEdge& edge : problem.edges) {
    const MovingNode from = node_at(edge.from), to = node_at(edge.to);
    Eigen::Matrix<double, kSize, 1> residual;
    PoseGraphCost<kSize>(edge, options, from, to).Evaluate(tangents.data(), residual.data(), nullptr);
    sum += residual.squaredNorm();
  }
  return 0.5 * sum;
}

}  // namespace

Result<> PoseGraphProblem::Check() const {
  const auto is_index = [&](int index) { return index >= 0 && static_cast<size_t>(index) < nodes.size(); };
  for (size_t i = 0; i < edges.size(); ++i) {
    const std::string name = "edge " + std::to_string(i);
    if (!is_index(edges[i].from) || !is_index(edges[i].to) || edges[i].from == edges[i].to) {
      return Failed(name + " must name two different nodes of the problem");
    }
    if (!(edges[i].weight > 0.0) || !(edges[i].length > 0.0) || !(edges[i].to_from_from.scale > 0.0)) {
      return Failed(name + " has a weight, a length or a scale that is not positive");
    }
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!(nodes[i].world_from_keyframe.scale > 0.0)) {
      return Failed("node " + std::to_string(i) + " has a scale that is not positive");
    }
  }
  if (std::none_of(nodes.begin(), nodes.end(), [](const PoseGraphNode& node) { return node.is_fixed; })) {
    return Failed("no node is fixed; fix one at least (gauge)");
  }
  return {};
}

Result<> PoseGraphOptions::Check() const {
  if (max_num_iterations < 1) return Failed("a pose graph needs at least one iteration");
  if (!(function_tolerance >= 0.0)) return Failed("function_tolerance must not be negative");
  if (!(translation_sigma > 0.0) || !(rotation_sigma_rad > 0.0) || !(log_scale_sigma > 0.0)) {
    return Failed("translation_sigma, rotation_sigma_rad and log_scale_sigma must be positive");
  }
  return {};
}

std::optional<std::vector<Sim3>> OptimizePoseGraph(const PoseGraphProblem& problem, const PoseGraphOptions& options) {
  ThrowIfFailed<std::invalid_argument>(problem.Check(), "OptimizePoseGraph: ");
  ThrowIfFailed<std::invalid_argument>(options.Check(), "OptimizePoseGraph: ");
  if (!IsFinite(problem)) return std::nullopt;
  return problem.has_scale ? PoseGraphSolver<7>(problem, options).Solve()
                           : PoseGraphSolver<6>(problem, options).Solve();
}

double PoseGraphCostAt(const std::vector<Sim3>& world_from_keyframe, const PoseGraphProblem& problem,
                       const PoseGraphOptions& options) {
  return problem.has_scale ? CostAt<7>(world_from_keyframe, problem, options)
                           : CostAt<6>(world_from_keyframe, problem, options);
}

}  // namespace tessera
