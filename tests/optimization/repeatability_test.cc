// The large solvers: what they give depends on values alone.
#include <gtest/gtest.h>

#include "core/sha256.h"
#include "optimization/bundle_adjustment.h"
#include "optimization/pose_graph.h"
#include "support/other_process.h"
#include "support/synthetic_problems.h"

namespace tessera {
namespace {

void Add(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation, Sha256& hash) {
  for (const double value : {rotation.w(), rotation.x(), rotation.y(), rotation.z()}) hash.Add(value);
  for (const double value : translation) hash.Add(value);
}

std::string DigestOf(const std::vector<Sim3>& poses) {
  Sha256 hash;
  for (const Sim3& pose : poses) {
    hash.Add(pose.scale);
    Add(pose.rotation, pose.translation, hash);
  }
  return hash.HexDigest();
}

std::string DigestOf(const BundleResult& result) {
  Sha256 hash;
  for (const Rigid3& pose : result.camera_from_world) Add(pose.rotation, pose.translation, hash);
  for (const Eigen::Vector3d& position : result.positions_in_world) {
    for (const double value : position) hash.Add(value);
  }
  hash.Add(static_cast<int64_t>(result.num_inliers));
  return hash.HexDigest();
}

TEST(Repeatability, PoseGraph) {
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = 500, .num_neighbors = 6});
  const auto first = OptimizePoseGraph(circuit.problem, {});
  const std::vector<double> moves_the_heap(12345, 1.0);
  const auto second = OptimizePoseGraph(PoseGraphProblem(circuit.problem), {});
  ASSERT_TRUE(first && second);
  EXPECT_EQ(DigestOf(*first), DigestOf(*second));
  ExpectSameInAnotherProcess(DigestOf(*first));
}

TEST(Repeatability, GlobalBundle) {
  for (const double share : {0.0, 0.5}) {
    const SyntheticBundle bundle =
        MakeSyntheticStreet({.num_keyframes = 70, .num_new_landmarks = 12, .share_with_right = share});
    const auto first = AdjustBundle(bundle.problem, GlobalBundleOptions());
    const std::vector<double> moves_the_heap(12345, 1.0);
    const auto second = AdjustBundle(BundleProblem(bundle.problem), GlobalBundleOptions());
    ASSERT_TRUE(first && second);
    EXPECT_EQ(DigestOf(*first), DigestOf(*second));
    if (share > 0.0) ExpectSameInAnotherProcess(DigestOf(*first));
  }
}

}  // namespace
}  // namespace tessera
