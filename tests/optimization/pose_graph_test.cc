#include "optimization/pose_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "optimization/pose_graph_costs.h"
#include "support/synthetic_problems.h"

namespace tessera {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double Distance(const Sim3& a, const Sim3& b) { return TangentOf(a.Inverse() * b).norm(); }

double MaxDistance(const std::vector<Sim3>& a, const std::vector<Sim3>& b) {
  double distance = 0.0;
  for (size_t i = 0; i < a.size(); ++i) distance = std::max(distance, Distance(a[i], b[i]));
  return distance;
}

bool SameBits(const Sim3& a, const Sim3& b) {
  return a.scale == b.scale && a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

PoseGraphOptions Exhaustive() { return {.max_num_iterations = 200, .function_tolerance = 1e-14}; }

// A graph that its truth fulfils exactly, started away from it.
SyntheticCircuit MakeConsistentGraph(bool has_scale) {
  SyntheticCircuit circuit =
      MakeSyntheticCircuit({.num_keyframes = 40, .step_m = 2.0, .has_scale = has_scale, .log_scale_sigma = 0.02});
  for (PoseGraphEdge& edge : circuit.problem.edges) {
    edge.to_from_from = circuit.world_from_keyframe[static_cast<size_t>(edge.to)].Inverse() *
                        circuit.world_from_keyframe[static_cast<size_t>(edge.from)];
  }
  return circuit;
}

TEST(OptimizePoseGraph, ConsistentEdgesGiveTheTruth) {
  for (const bool has_scale : {true, false}) {
    const SyntheticCircuit circuit = MakeConsistentGraph(has_scale);
    EXPECT_GT(MaxDistance(PosesOf(circuit.problem), circuit.world_from_keyframe), 0.05);
    const auto poses = OptimizePoseGraph(circuit.problem, {});
    ASSERT_TRUE(poses.has_value());
    EXPECT_LT(MaxDistance(*poses, circuit.world_from_keyframe), 1e-6);
  }
}

// One loop at the end of a long open path. Twenty iterations are enough to spread its error for good.
TEST(OptimizePoseGraph, LongChainsConvergeInTheIterationsGiven) {
  for (const int num_keyframes : {300, 1000, 3000}) {
    const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = num_keyframes,
                                                           .step_m = 2.0,
                                                           .num_neighbors = 2,
                                                           .rotation_sigma_rad = 0.0003,
                                                           .log_scale_sigma = 0.002,
                                                           .log_scale_drift = 0.5});
    const auto poses = OptimizePoseGraph(circuit.problem, {}), limit = OptimizePoseGraph(circuit.problem, Exhaustive());
    ASSERT_TRUE(poses && limit);
    const double before = CircuitError(circuit, PosesOf(circuit.problem), 1.0);
    const double after = CircuitError(circuit, *poses, 1.0);
    EXPECT_LT(after, 0.15 * before) << num_keyframes;
    EXPECT_NEAR(after / CircuitError(circuit, *limit, 1.0), 1.0, 0.01) << num_keyframes;
    const Sim3 gap = circuit.problem.edges.back().to_from_from.Inverse() * (poses->front().Inverse() * poses->back());
    EXPECT_LT(gap.translation.norm(), 0.5) << num_keyframes;
    EXPECT_LT(std::abs(std::log(gap.scale)), 0.01) << num_keyframes;
  }
}

TEST(OptimizePoseGraph, WithoutALoopNothingMoves) {
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.has_loop = false});
  const auto poses = OptimizePoseGraph(circuit.problem, {});
  ASSERT_TRUE(poses.has_value());
  EXPECT_LT(MaxDistance(*poses, PosesOf(circuit.problem)), 1e-9);
}

TEST(OptimizePoseGraph, TheMapsUnitDoesNotMatter) {
  const SyntheticCircuit meters = MakeSyntheticCircuit({.unit = 1.0});
  const auto expected = OptimizePoseGraph(meters.problem, Exhaustive());
  ASSERT_TRUE(expected.has_value());
  for (const double unit : {0.01, 7.0, 1000.0}) {
    const SyntheticCircuit circuit = MakeSyntheticCircuit({.unit = unit});
    const auto poses = OptimizePoseGraph(circuit.problem, Exhaustive());
    ASSERT_TRUE(poses.has_value());
    for (size_t i = 0; i < poses->size(); ++i) {
      EXPECT_LT(((*poses)[i].translation / unit - (*expected)[i].translation).norm(), 1e-5) << unit;
      EXPECT_NEAR((*poses)[i].scale / (*expected)[i].scale, 1.0, 1e-7) << unit;
    }
  }
}

TEST(OptimizePoseGraph, WithoutScaleAllScalesStayToTheBit) {
  SyntheticCircuit circuit = MakeSyntheticCircuit({.has_scale = false});
  const auto rigid = OptimizePoseGraph(circuit.problem, {});
  ASSERT_TRUE(rigid.has_value());
  for (const Sim3& pose : *rigid) EXPECT_EQ(pose.scale, 1.0);
  EXPECT_LT(CircuitError(circuit, *rigid, 1.0), 0.5 * CircuitError(circuit, PosesOf(circuit.problem), 1.0));
  for (PoseGraphNode& node : circuit.problem.nodes) node.world_from_keyframe.scale = 1.1;
  const auto scaled = OptimizePoseGraph(circuit.problem, {});
  ASSERT_TRUE(scaled.has_value());
  for (const Sim3& pose : *scaled) EXPECT_EQ(pose.scale, 1.1);
}

TEST(OptimizePoseGraph, FixedNodesAndThoseTiedToNoneKeepTheirBits) {
  SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 50});
  PoseGraphProblem& problem = circuit.problem;
  problem.nodes[7].is_fixed = problem.nodes[8].is_fixed = true;
  // An island of two, which disagree with their edge.
  const int island = static_cast<int>(problem.nodes.size());
  problem.nodes.push_back({KeyframeId{98}, {1.3, ExpSO3({0.1, 0.2, 0.3}), {5.0, 6.0, 7.0}}});
  problem.nodes.push_back({KeyframeId{99}, {0.7, ExpSO3({0.3, 0.2, 0.1}), {5.0, 6.0, 8.0}}});
  problem.edges.push_back({island, island + 1, Sim3{}});
  const auto poses = OptimizePoseGraph(problem, {});
  ASSERT_TRUE(poses.has_value());
  for (size_t i = 0; i < poses->size(); ++i) {
    const bool stays = problem.nodes[i].is_fixed || i >= 50;
    EXPECT_EQ(SameBits((*poses)[i], problem.nodes[i].world_from_keyframe), stays) << i;
  }
}

TEST(OptimizePoseGraph, AnEdgeOfWeightTwoIsTwoEdges) {
  SyntheticCircuit once = MakeSyntheticCircuit({.num_keyframes = 60}), twice = once;
  for (size_t i = 0; i < once.problem.edges.size(); i += 3) {
    twice.problem.edges.push_back(once.problem.edges[i]);
    once.problem.edges[i].weight = 2.0;
  }
  const auto a = OptimizePoseGraph(once.problem, Exhaustive()), b = OptimizePoseGraph(twice.problem, Exhaustive());
  ASSERT_TRUE(a && b);
  EXPECT_LT(MaxDistance(*a, *b), 1e-6);
}

TEST(OptimizePoseGraph, AnEdgeReadBackwardsIsTheSame) {
  const SyntheticCircuit forwards = MakeSyntheticCircuit({.num_keyframes = 60});
  SyntheticCircuit backwards = forwards;
  for (PoseGraphEdge& edge : backwards.problem.edges) {
    edge = {edge.to, edge.from, edge.to_from_from.Inverse(), edge.weight, edge.length / edge.to_from_from.scale};
  }
  const auto a = OptimizePoseGraph(forwards.problem, Exhaustive());
  const auto b = OptimizePoseGraph(backwards.problem, Exhaustive());
  ASSERT_TRUE(a && b);
  // Not to the last digit: the residual is read in another frame, which is of second order in the errors.
  EXPECT_LT(MaxDistance(*a, *b), 0.05 * MaxDistance(*a, PosesOf(forwards.problem)));
}

TEST(OptimizePoseGraph, SameProblemGivesTheSameBits) {
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 400});
  const auto first = OptimizePoseGraph(circuit.problem, {});
  const std::vector<double> moves_the_heap(12345, 1.0);
  const PoseGraphProblem copy = circuit.problem;
  const auto second = OptimizePoseGraph(copy, {});
  ASSERT_TRUE(first && second);
  for (size_t i = 0; i < first->size(); ++i) EXPECT_TRUE(SameBits((*first)[i], (*second)[i])) << i;
}

TEST(OptimizePoseGraph, NothingFreeOrNotFiniteGivesNothing) {
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 20});
  PoseGraphProblem fixed = circuit.problem, untied = circuit.problem, spoilt = circuit.problem;
  for (PoseGraphNode& node : fixed.nodes) node.is_fixed = true;
  EXPECT_FALSE(OptimizePoseGraph(fixed, {}).has_value());
  untied.edges.clear();
  EXPECT_FALSE(OptimizePoseGraph(untied, {}).has_value());
  spoilt.nodes[3].world_from_keyframe.translation.x() = kNaN;
  EXPECT_FALSE(OptimizePoseGraph(spoilt, {}).has_value());
  spoilt = circuit.problem;
  spoilt.edges[3].to_from_from.rotation.w() = kNaN;
  EXPECT_FALSE(OptimizePoseGraph(spoilt, {}).has_value());
  spoilt = circuit.problem;
  spoilt.edges[3].covariance(2, 2) = kNaN;
  EXPECT_FALSE(OptimizePoseGraph(spoilt, {}).has_value());
}

TEST(OptimizePoseGraph, MalformedProblemsThrowWithASentence) {
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 20});
  const std::vector<std::function<void(PoseGraphProblem&)>> spoilers = {
      [](PoseGraphProblem& p) { p.edges[2].to = 20; },
      [](PoseGraphProblem& p) { p.edges[2].from = -1; },
      [](PoseGraphProblem& p) { p.edges[2].from = p.edges[2].to; },
      [](PoseGraphProblem& p) { p.edges[2].weight = 0.0; },
      [](PoseGraphProblem& p) { p.edges[2].length = kNaN; },
      [](PoseGraphProblem& p) { p.edges[2].to_from_from.scale = -1.0; },
      [](PoseGraphProblem& p) { p.nodes[2].world_from_keyframe.scale = 0.0; },
      [](PoseGraphProblem& p) { p.nodes[0].is_fixed = false; },
  };
  for (size_t i = 0; i < spoilers.size(); ++i) {
    PoseGraphProblem problem = circuit.problem;
    spoilers[i](problem);
    EXPECT_FALSE(problem.Check()) << i;
    EXPECT_THROW(OptimizePoseGraph(problem, {}), std::invalid_argument) << i;
  }
  EXPECT_THROW(OptimizePoseGraph(circuit.problem, {.max_num_iterations = 0}), std::invalid_argument);
  EXPECT_THROW(OptimizePoseGraph(circuit.problem, {.rotation_sigma_rad = 0.0}), std::invalid_argument);
}

// A circuit that slipped at one link: what comes after it is three times too large.
SyntheticCircuit MakeSlippedCircuit(size_t slip, double factor) {
  SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 80,
                                                   .num_neighbors = 1,
                                                   .rotation_sigma_rad = 0.0,
                                                   .translation_sigma = 0.0,
                                                   .log_scale_sigma = 0.0});
  std::vector<PoseGraphNode>& nodes = circuit.problem.nodes;
  const Eigen::Vector3d pivot = nodes[slip].world_from_keyframe.translation;
  for (size_t i = slip; i < nodes.size(); ++i) {
    Eigen::Vector3d& translation = nodes[i].world_from_keyframe.translation;
    translation = pivot + factor * (translation - pivot);
    circuit.world_from_keyframe[i].scale = 1.0 / factor;
  }
  for (PoseGraphEdge& edge : circuit.problem.edges) {
    const auto from = static_cast<size_t>(edge.from), to = static_cast<size_t>(edge.to);
    const bool is_loop = &edge == &circuit.problem.edges.back();
    const std::vector<Sim3> poses = is_loop ? circuit.world_from_keyframe : PosesOf(circuit.problem);
    edge.to_from_from = poses[to].Inverse() * poses[from];
  }
  return circuit;
}

TEST(OptimizePoseGraph, AWeakLinkTakesTheCorrectionAndEqualLinksShareIt) {
  constexpr size_t kSlip = 30;
  SyntheticCircuit circuit = MakeSlippedCircuit(kSlip, 3.0);
  const double before = CircuitError(circuit, PosesOf(circuit.problem), 1.0);
  const auto shared = OptimizePoseGraph(circuit.problem, {});
  ASSERT_TRUE(shared.has_value());
  for (size_t i = 1; i < shared->size(); ++i) {
    EXPECT_LT(std::abs(std::log((*shared)[i].scale / (*shared)[i - 1].scale)), 0.1) << "no link takes all of it";
  }
  for (PoseGraphEdge& edge : circuit.problem.edges) {
    if (edge.to == static_cast<int>(kSlip)) edge.covariance(6, 6) = 1.0;
  }
  const auto right = OptimizePoseGraph(circuit.problem, {});
  ASSERT_TRUE(right.has_value());
  EXPECT_LT(CircuitError(circuit, *right, 1.0), 0.05 * before);
  EXPECT_GT(CircuitError(circuit, *shared, 1.0), 5.0 * CircuitError(circuit, *right, 1.0));
}

template <int kSize>
void CheckJacobian() {
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using RowMajor = Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor>;
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> log_scale(-0.5, 0.5);
  for (const double size : {0.0, 1e-6, 1e-3, 0.1, 0.8}) {
    Vector tangents[2];
    MovingNode nodes[2];
    for (int k = 0; k < 2; ++k) {
      for (Eigen::Index i = 0; i < kSize; ++i) tangents[k](i) = size * UniformVector(generator, 1.0).x();
      const double scale = std::exp(log_scale(generator));
      nodes[k].base = {scale, ExpSO3(UniformVector(generator, 1.0)), UniformVector(generator, 3.0)};
      nodes[k].tangent = tangents[k].data();
      nodes[k].has_scale = kSize == 7;
      nodes[k].Update();
    }
    Eigen::Matrix<double, 7, 1> error;
    error.head<3>() = UniformVector(generator, size);
    error.segment<3>(3) = UniformVector(generator, size);
    error(6) = size * log_scale(generator);
    const Sim3 predicted = nodes[1].world_from_keyframe.Inverse() * nodes[0].world_from_keyframe;
    const PoseGraphEdge edge{0, 1, predicted * Retract(Sim3{}, error).Inverse(), 2.0, 3.0};
    const PoseGraphOptions options{.translation_sigma = 0.5, .rotation_sigma_rad = 2.0, .log_scale_sigma = 1.5};
    const PoseGraphCost<kSize> cost(edge, options, nodes[0], nodes[1]);
    const double* parameters[2] = {tangents[0].data(), tangents[1].data()};
    const auto residual_at = [&] {
      for (MovingNode& node : nodes) node.Update();
      Vector residual;
      cost.Evaluate(parameters, residual.data(), nullptr);
      return residual;
    };
    Vector expected = error.head<kSize>() * std::sqrt(2.0);
    expected.template head<3>() /= 3.0 * 0.5;
    expected.template segment<3>(3) /= 2.0;
    if (kSize == 7) expected(kSize - 1) /= 1.5;
    EXPECT_LT((residual_at() - expected).norm(), 1e-12) << size;
    RowMajor analytic[2];
    double* blocks[2] = {analytic[0].data(), analytic[1].data()};
    Vector residual;
    cost.Evaluate(parameters, residual.data(), blocks);
    for (int k = 0; k < 2; ++k) {
      for (Eigen::Index i = 0; i < kSize; ++i) {
        const double value = tangents[k](i), step = 1e-5;
        tangents[k](i) = value + step;
        const Vector after = residual_at();
        tangents[k](i) = value - step;
        const Vector before = residual_at();
        tangents[k](i) = value;
        residual_at();
        EXPECT_LT((analytic[k].col(i) - (after - before) / (2.0 * step)).norm(), 1e-7) << size << " " << k << " " << i;
      }
    }
  }
}

TEST(PoseGraphCost, ResidualIsTheErrorAndJacobianTheNumericOne) {
  CheckJacobian<7>();
  CheckJacobian<6>();
}

}  // namespace
}  // namespace tessera
