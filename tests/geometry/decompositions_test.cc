#include "geometry/decompositions.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace tessera {
namespace {

// A sum of `rank` outer products, none along `shrunk`.
Matrix9d NormalOf(int rank, const Vector9d& shrunk) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  Matrix9d sum = Matrix9d::Zero();
  for (int i = 0; i < rank; ++i) {
    Vector9d row = Vector9d::NullaryExpr([&](Eigen::Index) { return normal(generator); });
    row -= shrunk.dot(row) * shrunk;
    sum += row * row.transpose();
  }
  return sum;
}

TEST(NullVector, IsTheDirectionThatNoMeasurementShows) {
  const Vector9d shrunk = Vector9d::LinSpaced(-1.0, 2.0).normalized();
  const std::optional<Vector9d> found = NullVector(NormalOf(8, shrunk));
  ASSERT_TRUE(found);
  EXPECT_NEAR(std::abs(found->dot(shrunk)), 1.0, 1e-12);
}

TEST(NullVector, ReadsTheLowerTriangleOnly) {
  const Vector9d shrunk = Vector9d::LinSpaced(-1.0, 2.0).normalized();
  const Matrix9d normal = NormalOf(8, shrunk);
  EXPECT_EQ(NullVector(normal.triangularView<Eigen::Lower>()), NullVector(normal));
}

TEST(NullVector, IsNotFixedByTooFewMeasurements) { EXPECT_FALSE(NullVector(NormalOf(7, Vector9d::Unit(2)))); }

TEST(InverseOf, TimesTheMatrixIsTheIdentity) {
  const Eigen::MatrixXd matrix = NormalOf(12, Vector9d::Unit(8)).topLeftCorner(7, 7);
  EXPECT_TRUE((InverseOf(matrix) * matrix).isIdentity(1e-9));
}

TEST(InverseOf, ASingularMatrixIsNotFinite) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(5, 5);
  matrix(3, 3) = 0.0;
  EXPECT_FALSE(InverseOf(matrix).allFinite());
}

}  // namespace
}  // namespace tessera
