// Dense and sparse reduced systems against Eigen's factorization of the whole matrix.
#include "optimization/reduced_system.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace tessera {
namespace {

constexpr int kNumPoses = 40;

// A street whose end meets its beginning: every pose shares points with the three before it.
std::vector<ReducedSystem::Place> StreetPlaces() {
  std::vector<ReducedSystem::Place> places;
  for (int row = 0; row < kNumPoses; ++row) {
    for (int column = std::max(0, row - 3); column <= row; ++column) places.push_back({row, column});
  }
  places.push_back({kNumPoses - 1, 0});
  places.push_back({kNumPoses - 2, 1});
  return places;
}

// Positive definite, with all places of the street filled; and a right side.
struct System {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(6 * kNumPoses, 6 * kNumPoses);
  std::vector<ReducedSystem::Vector> right{static_cast<size_t>(kNumPoses)};

  System() {
    std::mt19937_64 generator(3);
    const auto random = [&] { return 1e-3 * static_cast<double>(generator() % 2001) - 1.0; };
    for (const auto& [row, column] : StreetPlaces()) {
      const ReducedSystem::Block block = ReducedSystem::Block::NullaryExpr(random);
      matrix.block<6, 6>(6 * row, 6 * column) = block;
      matrix.block<6, 6>(6 * column, 6 * row) = block.transpose();
    }
    matrix = 0.5 * (matrix + matrix.transpose()).eval();
    matrix.diagonal().array() += 40.0;
    for (ReducedSystem::Vector& vector : right) vector = ReducedSystem::Vector::NullaryExpr(random);
  }

  void FillIn(ReducedSystem& system) const {
    system.Clear();
    for (const auto& [row, column] : StreetPlaces()) {
      system.At(row, column) = matrix.block<6, 6>(6 * row, 6 * column);
    }
  }
};

std::vector<std::unique_ptr<ReducedSystem>> BothSystems() {
  std::vector<std::unique_ptr<ReducedSystem>> systems;
  systems.push_back(MakeDenseSystem(kNumPoses));
  systems.push_back(MakeSparseSystem(kNumPoses, StreetPlaces()));
  return systems;
}

TEST(ReducedSystem, IsSolvedDenseAndSparse) {
  const System truth;
  const Eigen::Map<const Eigen::VectorXd> right(truth.right.front().data(), 6 * kNumPoses);
  const Eigen::VectorXd expected = truth.matrix.ldlt().solve(right);
  for (const auto& system : BothSystems()) {
    for (int time = 0; time < 2; ++time) {  // a system can be filled again
      truth.FillIn(*system);
      std::vector<ReducedSystem::Vector> solution = truth.right;
      ASSERT_TRUE(system->Solve(solution));
      const Eigen::Map<const Eigen::VectorXd> found(solution.front().data(), 6 * kNumPoses);
      EXPECT_LT((found - expected).norm(), 1e-12 * expected.norm());
    }
  }
}

TEST(ReducedSystem, IsRefusedIfItIsNotPositiveDefinite) {
  const System truth;
  for (const auto& system : BothSystems()) {
    truth.FillIn(*system);
    system->At(17, 17).diagonal().array() -= 100.0;
    std::vector<ReducedSystem::Vector> solution = truth.right;
    EXPECT_FALSE(system->Solve(solution));
  }
}

TEST(ReducedSystem, ThePlacesOfASparseOneMayComeInAnyOrder) {
  const System truth;
  std::vector<ReducedSystem::Place> reversed = StreetPlaces();
  std::ranges::reverse(reversed);
  const auto in_order = MakeSparseSystem(kNumPoses, StreetPlaces()), backward = MakeSparseSystem(kNumPoses, reversed);
  std::vector<ReducedSystem::Vector> first = truth.right, second = truth.right;
  truth.FillIn(*in_order);
  truth.FillIn(*backward);
  ASSERT_TRUE(in_order->Solve(first) && backward->Solve(second));
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace tessera
