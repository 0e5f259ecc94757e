#include "occupancy/ray_caster.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "support/depth_room.h"

namespace tessera {
namespace {

constexpr double kVoxel = 0.1;
const OccupancyOptions kOptions{.resolution = kVoxel, .max_range = 2.0};

Scan ScanOf(std::vector<Eigen::Vector3d> points) {
  Scan scan;
  scan.landmarks_in_camera = std::move(points);
  return scan;
}

// The key of the voxel that holds a point.
octomap::OcTreeKey KeyAt(double x, double y, double z) { return octomap::OcTree(kVoxel).coordToKey(x, y, z); }

TEST(RayCaster, ARayMissesTheVoxelsOnItsWayAndHitsTheLast) {
  const Rigid3 pose{Eigen::Quaterniond::Identity(), {0.05, 0.05, 0.05}};
  const SeenVoxels seen = RayCaster(kOptions).Cast(ScanOf({{0, 0, 1.0}}), pose);
  ASSERT_EQ(seen.hits.size(), 1U);
  EXPECT_EQ(seen.hits[0].voxel, KeyAt(0.05, 0.05, 1.05));
  ASSERT_EQ(seen.misses.size(), 10U);
  for (size_t i = 0; i < seen.misses.size(); ++i) {
    EXPECT_EQ(seen.misses[i], KeyAt(0.05, 0.05, 0.05 + kVoxel * static_cast<double>(i)));
  }
}

TEST(RayCaster, ARayEndsAtTheMaximumRangeAndHitsNothingThere) {
  const Rigid3 pose{Eigen::Quaterniond::Identity(), {0.05, 0.05, 0.05}};
  const SeenVoxels seen = RayCaster(kOptions).Cast(ScanOf({{0, 0, 7.0}}), pose);
  EXPECT_TRUE(seen.hits.empty());
  EXPECT_EQ(seen.misses.size(), 21U);
}

TEST(RayCaster, WhatIsNearerThanTheMinimumRangeIsLeftOut) {
  OccupancyOptions options = kOptions;
  options.min_range = 0.7;
  const SeenVoxels seen = RayCaster(options).Cast(ScanOf({{0, 0, 0.5}}), Rigid3::Identity());
  EXPECT_TRUE(seen.hits.empty());
  EXPECT_TRUE(seen.misses.empty());
  EXPECT_EQ(RayCaster(options).Cast(ScanOf({{0, 0, 1.0}}), Rigid3::Identity()).hits.size(), 1U);
}

TEST(RayCaster, WhereStereoMayBeWrongARayMissesNothing) {
  const Rigid3 pose{Eigen::Quaterniond::Identity(), {0.05, 0.05, 0.05}};
  Scan scan = ScanOf({{0, 0, 1.0}});
  scan.camera = {.sensor = SensorType::kStereo, .fx_px = 22.0, .baseline_m = 0.1};
  EXPECT_NEAR(UncertaintyAt(1.0, scan.camera), 0.227, 1e-3);
  const SeenVoxels seen = RayCaster(kOptions).Cast(scan, pose);
  ASSERT_EQ(seen.hits.size(), 1U);
  EXPECT_EQ(seen.misses.size(), 8U) << "up to 0.77 m";
}

TEST(RayCaster, AVoxelIsSeenOnceAndNoHitIsAlsoAMiss) {
  const Rigid3 pose = CameraAt({0.1, 0.0, 0.0}, 0.3);
  const SeenVoxels seen = RayCaster(RoomOptions()).Cast(*ScanOfRoom(pose), pose);
  std::set<std::array<octomap::key_type, 3>> voxels;
  const auto add = [&](const octomap::OcTreeKey& key) { EXPECT_TRUE(voxels.insert({key[0], key[1], key[2]}).second); };
  for (const SeenVoxels::Hit& hit : seen.hits) add(hit.voxel);
  for (const octomap::OcTreeKey& miss : seen.misses) add(miss);
  EXPECT_GT(seen.hits.size(), 300U);
  EXPECT_GT(seen.misses.size(), 1500U);
}

TEST(RayCaster, WhatLiesBehindTheCameraOrOutOfSpaceIsPassedOver) {
  RayCaster caster(kOptions);
  EXPECT_TRUE(caster.Cast(ScanOf({{0, 0, -1.0}, {1, 0, 0}}), {}).misses.empty());
  const Rigid3 far{Eigen::Quaterniond::Identity(), {1e6, 0, 0}};
  EXPECT_TRUE(caster.Cast(ScanOf({{0, 0, 1.0}}), far).misses.empty());
}

}  // namespace
}  // namespace tessera
