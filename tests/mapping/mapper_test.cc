#include "mapping/mapper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Drives through the world as a tracker would tell it: each keyframe's pose relative to the one before, with an
// error, and what it sees in common with the one before, of the points whose number `known` picks.
class Drive {
 public:
  Drive(SyntheticWorld& world, double pose_error, size_t known) : world_(world), error_(pose_error), known_(known) {}

  KeyframeObservation Next(int64_t step) {
    const SyntheticWorld::Picture picture = world_.Take(step);
    KeyframeObservation seen;
    seen.id = {next_id_++};
    seen.features = picture.features;
    seen.landmarks.resize(picture.points.size());
    const Rigid3 truth = world_.Pose(static_cast<double>(step));
    seen.reference = {seen.id.value - 1};
    const double sign = seen.id.value % 2 == 0 ? 1.0 : -1.0;
    Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Constant(sign * error_);
    error.tail<3>() *= 0.2;
    seen.reference_from_camera = Retract(last_truth_.Inverse() * truth, error);
    seen.world_from_camera = seen.id.value == 0 ? truth : last_estimate_ * seen.reference_from_camera;
    for (size_t i = 0; i < picture.points.size(); ++i) {
      const auto before = last_keypoints_.find(picture.points[i]);
      if (before == last_keypoints_.end() || picture.points[i] % known_ != 0) continue;
      seen.shared.push_back({static_cast<int32_t>(i), seen.reference, before->second, world_.point(picture.points[i])});
      told_.insert(picture.points[i]);
    }
    last_keypoints_.clear();
    for (size_t i = 0; i < picture.points.size(); ++i) last_keypoints_[picture.points[i]] = static_cast<int32_t>(i);
    last_truth_ = truth;
    last_estimate_ = seen.world_from_camera;
    points_.push_back(picture.points);
    return seen;
  }

  // Points of which the tracker knew two views.
  size_t num_told() const { return told_.size(); }
  // The point that a keypoint of a keyframe shows.
  size_t PointOf(const Observation& o) const {
    return points_[static_cast<size_t>(o.keyframe.value)][static_cast<size_t>(o.keypoint)];
  }

 private:
  SyntheticWorld& world_;
  double error_;
  size_t known_;
  int64_t next_id_ = 0;
  Rigid3 last_truth_, last_estimate_;
  std::map<size_t, int32_t> last_keypoints_;
  std::set<size_t> told_;
  std::vector<std::vector<size_t>> points_;  // by keyframe and keypoint
};

double CenterError(const Rigid3& a, const Rigid3& b) { return (a.translation - b.translation).norm(); }

// Share of observations that show another point than the landmark's first one.
double WrongShare(const Map& map, const Drive& drive) {
  int num_wrong = 0, num_all = 0;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    const std::span<const Observation> observations = map.ObservationsOf(id);
    for (const Observation& observation : observations) {
      num_wrong += drive.PointOf(observation) != drive.PointOf(observations.front()) ? 1 : 0;
      ++num_all;
    }
  });
  return static_cast<double>(num_wrong) / num_all;
}

TEST(Mapper, MonoCorrectsPosesAndFindsTheOtherPoints) {
  SyntheticWorld world(SensorType::kMono, 0.0);
  // 2 cm and 4 mrad, 2 px: where a pose is off by more than fusion looks around (3 px), nobody confirms a new point.
  Drive drive(world, 0.02, 3);
  Mapper mapper({});
  for (int64_t step = 0; step < 12; ++step) {
    KeyframeObservation seen = drive.Next(step);
    if (step == 1) seen.reference_from_camera = world.Pose(0.0).Inverse() * world.Pose(1.0);  // fixes the scale
    EXPECT_EQ(mapper.Process(seen).answers, seen.id);
  }
  const Map& map = mapper.map();
  EXPECT_LT(WrongShare(map, drive), 0.01);
  EXPECT_GT(map.landmarks().size(), 2 * static_cast<int64_t>(drive.num_told()));  // a third of the points was told
  EXPECT_GT(drive.num_told(), 100U);
  map.keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) {
    const Rigid3 truth = world.Pose(static_cast<double>(keyframe.features->frame.value));
    EXPECT_LT(CenterError(keyframe.world_from_camera, truth), 1e-3) << keyframe.features->frame.value;
  });
  std::vector<double> errors;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const size_t point = drive.PointOf(map.ObservationsOf(id).front());
    errors.push_back((landmark.position_in_world - world.point(point)).norm());
  });
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() * 9 / 10], 5e-3);
}

// Where poses are off by more than fusion looks around (3 px), nobody confirms a new point: it stays where the images
// fix the way, and goes while the way is open.
TEST(Mapper, NewPointsNeedToBeConfirmedWhereTheWayIsOpen) {
  SyntheticWorld world(SensorType::kMono, 0.0);
  Drive drive(world, 0.04, 3);
  Mapper mapper({.num_cautious_keyframes = 2});
  std::vector<size_t> num_new;  // by step: landmarks that only the pair observes that made them
  for (int64_t step = 0; step < 10; ++step) {
    KeyframeObservation seen = drive.Next(step);
    if (step == 4) seen.expected = {seen.reference_from_camera.translation, 1e-6 * Eigen::Matrix3d::Identity()};
    mapper.Process(seen);
    num_new.push_back(0);
    mapper.map().landmarks().ForEach([&](LandmarkId id, const Landmark&) {
      const std::span<const Observation> observations = mapper.map().ObservationsOf(id);
      const bool is_pair = observations.size() == 2 && observations.back().keyframe == seen.id;
      num_new.back() += is_pair ? 1 : 0;
    });
  }
  for (const size_t step : {4U, 5U, 6U}) EXPECT_LT(num_new[step], 20U) << step;
  for (const size_t step : {3U, 7U, 8U, 9U}) EXPECT_GT(num_new[step], 30U) << step;
}

TEST(Mapper, StereoBuildsAMapFromDepthUnderNoise) {
  SyntheticWorld world(SensorType::kStereo, 0.5);
  Drive drive(world, 0.02, 2);
  Mapper mapper({});
  for (int64_t step = 0; step < 12; ++step) (void)mapper.Process(drive.Next(step));
  EXPECT_LT(WrongShare(mapper.map(), drive), 0.02);
  mapper.map().keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) {
    const Rigid3 truth = world.Pose(static_cast<double>(keyframe.features->frame.value));
    EXPECT_LT(CenterError(keyframe.world_from_camera, truth), 0.06);  // 1 % of the way
  });
}

TEST(Mapper, TheDoubleWindowCorrectsPosesToo) {
  SyntheticWorld world(SensorType::kStereo, 0.5);
  Drive drive(world, 0.02, 2);
  MapperOptions options;
  options.window.is_double = true;
  options.window.max_inner_keyframes = 4;  // so that some keyframes stand outside
  Mapper mapper(options);
  for (int64_t step = 0; step < 12; ++step) (void)mapper.Process(drive.Next(step));
  mapper.map().keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) {
    const Rigid3 truth = world.Pose(static_cast<double>(keyframe.features->frame.value));
    EXPECT_LT(CenterError(keyframe.world_from_camera, truth), 0.06);
  });
}

TEST(Mapper, SameKeyframesMakeTheSameDeltasAndReplicasFollow) {
  SyntheticWorld world(SensorType::kStereo, 0.5);
  Drive drive(world, 0.02, 2);
  Mapper first({}), second({});
  Map replica;
  for (int64_t step = 0; step < 8; ++step) {
    const KeyframeObservation seen = drive.Next(step);
    const MapDelta delta = first.Process(seen);
    EXPECT_EQ(second.Process(seen).hash, delta.hash);
    EXPECT_THAT(replica.Apply(delta), IsSuccess());
  }
  EXPECT_EQ(replica.Sha256Hex(), second.map().Sha256Hex());
}

TEST(Mapper, RedundantKeyframesGoAndTheirPlaceIsRemembered) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  Drive drive(world, 0.0, 1);
  Mapper mapper({});
  for (int64_t k = 0; k < 15; ++k) (void)mapper.Process(drive.Next(k / 8));  // stands still twice
  EXPECT_LT(mapper.map().keyframes().size(), 12);
  for (int64_t k = 0; k < 15; ++k) {
    const auto pose = mapper.removed_keyframes().Find(mapper.map(), {k});
    ASSERT_TRUE(pose.has_value()) << k;
    EXPECT_LT(CenterError(pose->Pose(), world.Pose(static_cast<double>(k / 8))), 0.02);
  }
}

TEST(Mapper, LandmarksThatAreGoneAreSkipped) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  Drive drive(world, 0.0, 1);
  Mapper mapper({});
  (void)mapper.Process(drive.Next(0));
  KeyframeObservation seen = drive.Next(1);
  seen.landmarks[0] = {1000000};
  seen.landmarks[1] = seen.landmarks[2] = {0};  // one landmark can't be at two places
  seen.shared.push_back({0, {77}, 0, Eigen::Vector3d::Zero()});
  seen.shared.push_back({0, {0}, 1000000, Eigen::Vector3d::Zero()});
  (void)mapper.Process(seen);
  const Keyframe& keyframe = *mapper.map().FindKeyframe({1});
  EXPECT_NE(keyframe.landmarks[0], LandmarkId{1000000});
  EXPECT_LE(std::count(keyframe.landmarks.begin(), keyframe.landmarks.end(), LandmarkId{0}), 1);
}

TEST(Mapper, LandmarksThatAreNoneOfTheSceneGo) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  Drive drive(world, 0.0, 1);
  Mapper mapper({});
  (void)mapper.Process(drive.Next(0));
  ASSERT_NE(mapper.map().FindLandmark({20}), nullptr);
  KeyframeObservation seen = drive.Next(1);
  for (int64_t id = 0; id < 20; ++id) seen.not_scene.push_back({id});
  seen.not_scene.push_back({1000000});
  const MapDelta second = mapper.Process(seen);
  for (int64_t id = 0; id < 20; ++id) {
    EXPECT_EQ(mapper.map().FindLandmark({id}), nullptr);
    EXPECT_EQ(std::ranges::count(second.removed_landmarks, LandmarkId{id}), 1);
  }
  EXPECT_NE(mapper.map().FindLandmark({20}), nullptr);
}

// The keyframe comes into a map whose last keyframes are twice as far apart as they were.
TEST(Mapper, MendsTheScaleBeforeTheKeyframeComesInUnlessALoopHasSetIt) {
  for (const bool has_loop : {false, true}) {
    SyntheticWorld world(SensorType::kMono, 0.0);
    Drive drive(world, 0.0, 1);
    MapperOptions options;
    options.keyframe_culling.kept_newest = 100;
    options.window.max_inner_keyframes = 2;  // the rest of this small world would mend it back
    Mapper mapper(options);
    for (int64_t step = 0; step < 8; ++step) (void)mapper.Process(drive.Next(step));
    if (has_loop) {
      LoopResult loop{.answers = {7}, .matched = {0}, .corrections = {}, .seen = {}};
      (void)mapper.Process(drive.Next(8), {.loops = {loop}, .adjustment = {}});
    }
    const auto place = [&](int64_t k) { return mapper.map().FindKeyframe({k})->world_from_camera; };
    const auto length = [&](int64_t from, int64_t to) { return CenterError(place(from), place(to)); };
    const double before = length(4, 6), sound = length(0, 3);
    KeyframeObservation seen = drive.Next(has_loop ? 9 : 8);
    seen.mendings = {{{4}, std::log(2.0)}};
    EXPECT_EQ(mapper.LastStep(mapper.Process(seen)).is_repeatable, has_loop);
    EXPECT_EQ(mapper.num_scale_mendings(), has_loop ? 0 : 1);
    EXPECT_NEAR(length(4, 6) / before, has_loop ? 1.0 : 2.0, 0.1);
    EXPECT_NEAR(length(0, 3) / sound, 1.0, 0.1);
  }
}

TEST(Mapper, RefusesAKeyframeThatItHasOrThatDoesNotFit) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  Drive drive(world, 0.0, 1);
  Mapper mapper({});
  KeyframeObservation seen = drive.Next(0);
  (void)mapper.Process(seen);
  EXPECT_THROW((void)mapper.Process(seen), std::invalid_argument);
  seen.id = {5};
  seen.landmarks.pop_back();
  EXPECT_THROW((void)mapper.Process(seen), std::invalid_argument);
}

}  // namespace
}  // namespace tessera
