// What moves with the camera is told from the scene by what the rest of the image does.
#include "tracking/own_body.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry/rigid3.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr int64_t kInterval_us = 100'000;
constexpr float kBodyRow = 0.8F;  // of the image's height: where it begins

// Keypoints over the lower part of the image, `depth_m` before a camera with depth; the same for the same seed.
FeatureFrame BodyIn(const CameraCalibration& camera, double depth_m, uint64_t seed = 5) {
  std::mt19937_64 generator(seed);
  FeatureFrame body;
  const auto width = static_cast<float>(camera.width_px), height = static_cast<float>(camera.height_px);
  for (float y = kBodyRow * height + 6.0F; y < height - 6.0F; y += 12.0F) {
    for (float x = 8.0F; x < width - 8.0F; x += 12.0F) {
      Keypoint keypoint{.x_px = x, .y_px = y, .score = 100};
      if (camera.sensor == SensorType::kRgbd) keypoint.depth_m = static_cast<float>(depth_m);
      body.keypoints.push_back(keypoint);
      body.descriptors.push_back({generator(), generator(), generator(), generator()});
    }
  }
  return body;
}

// What the camera sees above the body, and the body.
FeatureFrame With(const FeatureFrame& body, FeatureFrame seen) {
  FeatureFrame features = seen;
  features.keypoints.clear();
  features.descriptors.clear();
  const float border = kBodyRow * static_cast<float>(seen.calibration.height_px);
  const bool is_empty = body.keypoints.empty();
  for (size_t i = 0; i < seen.keypoints.size(); ++i) {
    if (!is_empty && seen.keypoints[i].y_px > border) continue;
    features.keypoints.push_back(seen.keypoints[i]);
    features.descriptors.push_back(seen.descriptors[i]);
  }
  features.keypoints.insert(features.keypoints.end(), body.keypoints.begin(), body.keypoints.end());
  features.descriptors.insert(features.descriptors.end(), body.descriptors.begin(), body.descriptors.end());
  return features;
}

// A way of `num_frames` that goes `step` steps a frame and looks aside by a wave of this height.
OwnBody Drive(SensorType sensor, const FeatureFrame& body, double step, double turn_rad, int64_t num_frames) {
  SyntheticWorld world(sensor, 0.3, 4000);
  OwnBody found;
  for (int64_t frame = 0; frame < num_frames; ++frame) {
    Rigid3 world_from_camera = SyntheticWorld::Pose(step * static_cast<double>(frame));
    const double angle = turn_rad * static_cast<double>(std::abs(frame % 20 - 10)) / 10.0;
    world_from_camera.rotation = world_from_camera.rotation * ExpSO3({0.0, angle, 0.0});
    FeatureFrame features = With(body, world.Take(frame, world_from_camera).features);
    features.utime_us = kInterval_us * frame;
    found.Add(features);
  }
  return found;
}

int NumCovered(const OwnBody& body, const FeatureFrame& features) {
  return static_cast<int>(
      std::ranges::count_if(features.keypoints, [&](const Keypoint& keypoint) { return body.Covers(keypoint); }));
}

TEST(OwnBody, ShowsWhenACameraWithDepthGoesOn) {
  const SyntheticWorld world(SensorType::kRgbd);
  const FeatureFrame body = BodyIn(world.calibration(), 0.6);
  const OwnBody found = Drive(SensorType::kRgbd, body, 0.5, 0.0, 30);
  EXPECT_GT(NumCovered(found, body), 9 * static_cast<int>(body.keypoints.size()) / 10);
  EXPECT_LT(found.share(), 1.5 * (1.0 - static_cast<double>(kBodyRow))) << "what it hides, and little beside it";
}

TEST(OwnBody, ShowsWhenACameraTurnsThatKnowsNoDepth) {
  const SyntheticWorld world(SensorType::kMono);
  const FeatureFrame body = BodyIn(world.calibration(), 0.0);
  const OwnBody found = Drive(SensorType::kMono, body, 0.1, 0.6, 40);
  EXPECT_GT(NumCovered(found, body), 9 * static_cast<int>(body.keypoints.size()) / 10);
}

TEST(OwnBody, TheSceneIsNoneOfIt) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo, SensorType::kRgbd}) {
    for (const double turn : {0.0, 0.3}) {
      EXPECT_EQ(Drive(sensor, {}, 0.5, turn, 60).num_found(), 0) << "sensor " << static_cast<int>(sensor);
    }
  }
}

// As that of a lorry that drives in front for long.
TEST(OwnBody, WhatIsOutOfReachIsNoneOfIt) {
  const SyntheticWorld world(SensorType::kRgbd);
  EXPECT_EQ(Drive(SensorType::kRgbd, BodyIn(world.calibration(), 12.0), 0.5, 0.3, 60).num_found(), 0);
}

TEST(OwnBody, NothingIsKnownWhileTheCameraStands) {
  const SyntheticWorld world(SensorType::kRgbd);
  const FeatureFrame body = BodyIn(world.calibration(), 0.6);
  EXPECT_EQ(Drive(SensorType::kRgbd, body, 0.0, 0.0, 60).num_found(), 0);
}

// A car has driven along a road, and waits; then all but the road, which is nearer, goes by: a bus.
TEST(OwnBody, ARoadBeforeACameraThatStandsIsNone) {
  SyntheticWorld world(SensorType::kRgbd, 0.3, 4000);
  OwnBody body;
  const FeatureFrame road = BodyIn(world.calibration(), 1.0);
  for (int64_t frame = 0; frame < 100; ++frame) {
    const bool drives = frame < 60;
    const FeatureFrame before = drives ? BodyIn(world.calibration(), 1.0, static_cast<uint64_t>(frame)) : road;
    const Rigid3 passing = SyntheticWorld::Pose(0.5 * static_cast<double>(frame % 60));
    FeatureFrame features = With(before, world.Take(frame, passing).features);
    features.utime_us = kInterval_us * frame;
    body.Add(features);
    EXPECT_EQ(body.num_found(), 0) << frame;
  }
}

TEST(OwnBody, TheFrameWithoutItKeepsTheRestInItsOrder) {
  SyntheticWorld world(SensorType::kRgbd, 0.3, 4000);
  const FeatureFrame body = BodyIn(world.calibration(), 0.6);
  const OwnBody found = Drive(SensorType::kRgbd, body, 0.5, 0.0, 30);
  const FeatureFrame seen = With(body, world.Take(31).features);
  const FeatureFrame rest = found.Without(seen);
  ASSERT_EQ(rest.keypoints.size(), rest.descriptors.size());
  EXPECT_EQ(static_cast<int>(rest.keypoints.size()), static_cast<int>(seen.keypoints.size()) - NumCovered(found, seen));
  size_t next = 0;
  for (size_t i = 0; i < rest.keypoints.size(); ++i, ++next) {
    while (next < seen.keypoints.size() && found.Covers(seen.keypoints[next])) ++next;
    ASSERT_LT(next, seen.keypoints.size());
    EXPECT_EQ(rest.keypoints[i], seen.keypoints[next]);
    EXPECT_EQ(rest.descriptors[i], seen.descriptors[next]);
  }
}

TEST(OwnBody, AFrameOfAnotherCameraBeginsAnew) {
  SyntheticWorld world(SensorType::kRgbd);
  const FeatureFrame body = BodyIn(world.calibration(), 0.6);
  OwnBody found = Drive(SensorType::kRgbd, body, 0.5, 0.0, 30);
  ASSERT_GT(found.share(), 0.0);
  FeatureFrame other = world.Take(30).features;
  other.calibration.fx_px += 1.0;
  found.Add(other);
  EXPECT_EQ(found.share(), 0.0);
}

TEST(LandmarksOn, AreThoseSeenOnTheBodyAlone) {
  SyntheticWorld world(SensorType::kRgbd, 0.3, 4000);
  const FeatureFrame body = BodyIn(world.calibration(), 0.6);
  const OwnBody found = Drive(SensorType::kRgbd, body, 0.5, 0.0, 30);
  SyntheticWorld mapped(SensorType::kRgbd);
  PlantedMap planted(mapped);
  const KeyframeId first = planted.Add(0, {});
  planted.Add(1, first);
  const std::vector<LandmarkId> on_body = LandmarksOn(found, planted.map());
  int num_on = 0;
  planted.map().landmarks().ForEach([&](LandmarkId id, const auto&) {
    bool is_on = true;
    for (const Observation& observation : planted.map().ObservationsOf(id)) {
      const FeatureFrame& features = *planted.map().FindKeyframe(observation.keyframe)->features;
      is_on &= found.Covers(features.keypoints[static_cast<size_t>(observation.keypoint)]);
    }
    num_on += is_on ? 1 : 0;
    EXPECT_EQ(std::ranges::count(on_body, id), is_on ? 1 : 0);
  });
  EXPECT_GT(num_on, 0);
  EXPECT_TRUE(std::ranges::is_sorted(on_body));
}

}  // namespace
}  // namespace tessera
