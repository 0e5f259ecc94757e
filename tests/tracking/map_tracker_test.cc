#include "tracking/map_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <vector>

#include "mapping/mapper.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"
#include "tracking/tracker_time.h"

namespace tessera {
namespace {

struct Outcome {
  std::vector<PoseEstimate> poses;
  std::string map_sha256;
  std::vector<KeyframeObservation> keyframes;
  Mapper mapper{MapperOptions{}};
};

// Tracker and mapper together over frames of the world, but for those in `dropped`; deltas in logical time.
void Follow(SyntheticWorld world, int64_t num_frames, int64_t delay_frames, const std::vector<int64_t>& dropped,
            Outcome& outcome) {
  MapTracker tracker{MapTrackerOptions{}};
  LogicalTime time(delay_frames);
  for (int64_t step = 0; step < num_frames; ++step) {
    const FeatureFrame features = world.Take(step).features;
    if (std::find(dropped.begin(), dropped.end(), step) != dropped.end()) continue;
    ASSERT_TRUE(time.HasDeltas(features.frame));
    for (const auto& delta : time.TakeDeltas(features.frame)) ASSERT_THAT(tracker.ApplyDelta(*delta), IsSuccess());
    const MapTrackingResult result = tracker.Track(features);
    outcome.poses.push_back(result.pose);
    for (const KeyframeObservation& keyframe : result.keyframes) {
      time.KeyframeSent(keyframe.id, features.frame, 0);
      time.Receive(std::make_shared<const MapDelta>(outcome.mapper.Process(keyframe)));
      outcome.keyframes.push_back(keyframe);
    }
  }
  outcome.map_sha256 = outcome.mapper.map().Sha256Hex();
}

// The final place of a frame, in the world of the first.
Rigid3 FinalPose(const Outcome& outcome, const PoseEstimate& pose) {
  const auto reference = outcome.mapper.removed_keyframes().Find(outcome.mapper.map(), pose.reference_keyframe);
  return (reference.value_or(Sim3{}) * pose.reference_from_camera).Pose();
}

TEST(MapTracker, FollowsAStereoDrive) {
  const SyntheticWorld world(SensorType::kStereo, 0.3);
  Outcome outcome;
  Follow(world, 40, 3, {}, outcome);
  for (const PoseEstimate& pose : outcome.poses) {
    ASSERT_EQ(pose.state, TrackingState::kTracked) << pose.frame.value;
    const Rigid3 truth = world.Pose(0.0).Inverse() * world.Pose(static_cast<double>(pose.frame.value));
    EXPECT_LT((FinalPose(outcome, pose).translation - truth.translation).norm(), 0.05) << pose.frame.value;
  }
  EXPECT_GT(outcome.keyframes.size(), 3U);
}

// Steps of a meter where nothing is near: the farthest points are all that hold the camera.
// Without far points, the two frames by themselves show the way, and become keyframes.
TEST(MapTracker, FollowsWhatIsFarWhereNothingIsNear) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  for (const int min_points : {0, DepthPointOptions{}.min_points}) {
    const MapTrackerOptions options{.depth = {.max_baselines = 4.0, .min_points = min_points}};
    MapTracker tracker(options);
    const MapTrackingResult first = tracker.Track(world.Take(0).features);
    ASSERT_EQ(first.pose.state, TrackingState::kTracked);
    const MapTrackingResult second = tracker.Track(world.Take(1).features);
    EXPECT_EQ(second.pose.state, TrackingState::kTracked);
    EXPECT_EQ(second.keyframes.empty(), min_points > 0);
  }
}

// A keyframe's new points are no inliers of its pose.
TEST(MapTracker, InliersAreSomeOfTheMatches) {
  for (const SensorType sensor : {SensorType::kStereo, SensorType::kMono}) {
    Outcome outcome;
    Follow(SyntheticWorld(sensor, 0.3), 40, 3, {}, outcome);
    for (const PoseEstimate& pose : outcome.poses) {
      if (pose.state != TrackingState::kTracked) continue;
      EXPECT_GT(pose.num_inliers, 0) << pose.frame.value;
      EXPECT_LE(pose.num_inliers, pose.num_matches) << pose.frame.value;
      EXPECT_GT(pose.coverage, 0.0) << pose.frame.value;
    }
  }
}

TEST(MapTracker, KeyframesOfASteadyCameraSayWhereItWasExpectedWhereImagesLeaveItOpen) {
  Outcome outcome;
  Follow(SyntheticWorld(SensorType::kMono, 0.35, 500), 80, 3, {}, outcome);
  ASSERT_FALSE(outcome.keyframes.empty());
  EXPECT_FALSE(outcome.keyframes.front().expected.is_known()) << "nothing was seen of its motion yet";
  int num_known = 0;
  for (const KeyframeObservation& keyframe : outcome.keyframes) {
    if (!keyframe.expected.is_known()) continue;
    ++num_known;
    const Eigen::Vector3d error = keyframe.expected.position_in_reference - keyframe.reference_from_camera.translation;
    EXPECT_LT(error.norm(), 0.1 * keyframe.reference_from_camera.translation.norm()) << keyframe.id.value;
    EXPECT_LT(error.dot(keyframe.expected.information * error), 3.0 * 25.0) << "five sigma an axis";
  }
  EXPECT_GT(num_known, 2);
}

TEST(MapTracker, NothingIsExpectedOfAKeyframeWhoseWayImagesFix) {
  Outcome outcome;
  Follow(SyntheticWorld(SensorType::kStereo, 0.3, 5000), 40, 3, {}, outcome);
  EXPECT_GT(outcome.keyframes.size(), 3U);
  for (const KeyframeObservation& keyframe : outcome.keyframes) EXPECT_FALSE(keyframe.expected.is_known());
}

// As of a video whose rate was raised. A step of twice the length takes twice the time.
TEST(MapTracker, ARepeatedImageKeepsThePoseAndSaysNothingOfTheMotion) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  FeatureFrame last;
  Eigen::Vector3d pose_before = Eigen::Vector3d::Zero();
  for (int64_t step = 0; step < 12; ++step) {
    FeatureFrame features = world.Take(step).features;
    const bool is_repeated = step % 4 == 3;
    if (is_repeated) {
      last.frame = features.frame;
      last.utime_us = features.utime_us;
      features = last;
    }
    const MapTrackingResult result = tracker.Track(features);
    ASSERT_EQ(result.pose.state, TrackingState::kTracked) << step;
    EXPECT_EQ(result.pose.frame, features.frame);
    EXPECT_EQ(result.pose.since_tracked_us, is_repeated ? 100'000 : 0) << step;
    EXPECT_GT(result.pose.num_inliers, 0);
    if (is_repeated) {
      EXPECT_TRUE(result.keyframes.empty());
      EXPECT_EQ(result.pose.world_from_camera.translation, pose_before);
    }
    if (step > 4) {
      EXPECT_NEAR(result.pose.body.motion.velocity.norm(), 5.0, 0.5) << step;
    }
    pose_before = result.pose.world_from_camera.translation;
    last = std::move(features);
  }
  EXPECT_EQ(tracker.num_repeated(), 3);
}

TEST(MapTracker, ACameraThatStandsInARenderedWorldIsTrackedThoughItsImagesRepeat) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  FeatureFrame features = world.Take(0).features;
  for (int64_t step = 0; step < 20; ++step) {
    features.frame = {step};
    features.utime_us = 100'000 * step;
    const MapTrackingResult result = tracker.Track(features);
    EXPECT_EQ(result.pose.state, TrackingState::kTracked) << step;
    EXPECT_LE(result.pose.since_tracked_us, 500'000) << step;
  }
}

TEST(MapTracker, FollowsAMonoDriveUpToScale) {
  const SyntheticWorld world(SensorType::kMono, 0.3);
  Outcome outcome;
  Follow(world, 40, 3, {}, outcome);
  std::vector<double> scales;
  for (const PoseEstimate& pose : outcome.poses) {
    if (pose.state == TrackingState::kInitializing && pose.frame.value < 10) continue;
    ASSERT_EQ(pose.state, TrackingState::kTracked) << pose.frame.value;
    const Rigid3 truth = world.Pose(0.0).Inverse() * world.Pose(static_cast<double>(pose.frame.value));
    const Eigen::Vector3d estimate = FinalPose(outcome, pose).translation;
    EXPECT_GT(estimate.normalized().dot(truth.translation.normalized()), 0.999);
    scales.push_back(estimate.norm() / truth.translation.norm());
  }
  ASSERT_GT(scales.size(), 29U);
  EXPECT_NEAR(scales.back() / scales[scales.size() / 2], 1.0, 0.05);
}

// Steps of a meter and turns of up to 20 degrees from image to image: neither is near where the last motion leads.
TEST(MapTracker, FollowsMonoThroughWideStepsAndTurns) {
  SyntheticWorld world(SensorType::kMono, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  LogicalTime time(3);
  Mapper mapper{MapperOptions{}};
  for (int64_t step = 0; step < 20; ++step) {
    const double yaw_rad = step < 3 ? 0.0 : 0.18 * static_cast<double>(step % 4 < 2 ? 1 : -1);
    const Rigid3 truth = SyntheticWorld::Pose(2.0 * static_cast<double>(step)) *
                         Rigid3{ExpSO3({0.0, yaw_rad, 0.0}), Eigen::Vector3d::Zero()};
    FeatureFrame features = world.Take(step, truth).features;
    features.utime_us = 500000 * step;
    for (const auto& delta : time.TakeDeltas(features.frame)) ASSERT_THAT(tracker.ApplyDelta(*delta), IsSuccess());
    const MapTrackingResult result = tracker.Track(features);
    if (step > 1) {
      EXPECT_EQ(result.pose.state, TrackingState::kTracked) << step;
    }
    for (const KeyframeObservation& keyframe : result.keyframes) {
      time.KeyframeSent(keyframe.id, features.frame, 0);
      time.Receive(std::make_shared<const MapDelta>(mapper.Process(keyframe)));
    }
  }
}

TEST(MapTracker, FollowsACameraThatHasStoodForAWhile) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  const std::vector<double> steps = {0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5};
  double way = 0.0;
  for (int64_t frame = 0; frame < 22; ++frame) {
    if (frame >= 15) way += steps[static_cast<size_t>(frame - 15)];
    const Rigid3 truth{Eigen::Quaterniond::Identity(), {0.0, 0.0, way}};
    const MapTrackingResult result = tracker.Track(world.Take(frame, truth).features);
    ASSERT_EQ(result.pose.state, TrackingState::kTracked) << way;
    EXPECT_THAT(result.pose.world_from_camera, IsNear(truth, 0.03));
    for (const KeyframeObservation& keyframe : result.keyframes) {
      ASSERT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
    }
  }
}

TEST(MapTracker, SameFramesGiveTheSameMapAndDroppedOnesDoNotStopIt) {
  const SyntheticWorld world(SensorType::kStereo, 0.3);
  Outcome first, second, dropped;
  Follow(world, 20, 2, {}, first);
  Follow(world, 20, 2, {}, second);
  EXPECT_EQ(first.map_sha256, second.map_sha256);
  Follow(world, 20, 2, {4, 9, 10}, dropped);
  for (const PoseEstimate& pose : dropped.poses) EXPECT_EQ(pose.state, TrackingState::kTracked) << pose.frame.value;
}

TEST(MapTracker, MonoSaysByHowMuchTheScaleMayHaveDrifted) {
  const auto drift_after = [](SensorType sensor, double noise_px, int64_t num_frames) {
    SyntheticWorld world(sensor, noise_px);
    MapTracker tracker{MapTrackerOptions{}};
    Mapper mapper{MapperOptions{}};
    for (int64_t step = 0; step < num_frames; ++step) {
      for (const KeyframeObservation& keyframe : tracker.Track(world.Take(step).features).keyframes) {
        EXPECT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
      }
    }
    return tracker.scale_drift();
  };
  EXPECT_EQ(drift_after(SensorType::kStereo, 0.3, 40), 0.0);
  const double early = drift_after(SensorType::kMono, 0.3, 20), late = drift_after(SensorType::kMono, 0.3, 40);
  EXPECT_GT(early, 0.0);
  EXPECT_GT(late, early);
  EXPECT_LT(late, 0.1);
}

// Mono: two seconds without images, then nothing that was seen before. The new part is about where the camera went on
// to, in about the old scale.
TEST(MapTracker, ANewPartTakesOverScaleAndPositionFromTheMotionBeforeTheLoss) {
  SyntheticWorld world(SensorType::kMono, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  std::vector<PoseEstimate> before, after;
  for (int64_t step = 0; step < 65; ++step) {
    FeatureFrame features = world.Take(step).features;
    if (step >= 25 && step < 45) features.keypoints.clear(), features.descriptors.clear();
    if (step >= 45) {
      for (Descriptor& descriptor : features.descriptors) descriptor[0] ^= ~uint64_t{0}, descriptor[2] ^= ~uint64_t{0};
    }
    const MapTrackingResult result = tracker.Track(features);
    for (const KeyframeObservation& keyframe : result.keyframes) {
      ASSERT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
    }
    if (result.pose.state == TrackingState::kTracked) (step < 25 ? before : after).push_back(result.pose);
    EXPECT_EQ(result.pose.map_part.valid(), result.pose.state == TrackingState::kTracked);
  }
  ASSERT_GT(before.size(), 10U);
  ASSERT_GT(after.size(), 10U);
  EXPECT_EQ(before.back().map_part, KeyframeId{0});
  EXPECT_GT(after.front().map_part, KeyframeId{0});
  EXPECT_EQ(after.back().map_part, after.front().map_part);
  const auto length = [](const PoseEstimate& a, const PoseEstimate& b) {
    return (b.world_from_camera.translation - a.world_from_camera.translation).norm() /
           static_cast<double>(b.frame.value - a.frame.value);
  };
  const double step = length(before[5], before.back());
  EXPECT_NEAR(length(after[1], after.back()) / step, 1.0, 0.15);
  EXPECT_NEAR(length(before.back(), after[1]) / step, 1.0, 0.15);
}

// The state after each picture of a stereo drive; the mapper answers at once.
std::vector<TrackingState> StatesOf(int64_t num_frames,
                                    const std::function<FeatureFrame(SyntheticWorld&, int64_t)>& take) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  std::vector<TrackingState> states;
  for (int64_t step = 0; step < num_frames; ++step) {
    const MapTrackingResult result = tracker.Track(take(world, step));
    states.push_back(result.pose.state);
    for (const KeyframeObservation& keyframe : result.keyframes) {
      EXPECT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
    }
  }
  return states;
}

// The lens is covered.
FeatureFrame Blind(FeatureFrame features) {
  features.keypoints.clear();
  features.descriptors.clear();
  return features;
}

TEST(MapTracker, FindsItselfAgainAfterBlindFrames) {
  const std::vector<TrackingState> states = StatesOf(12, [](SyntheticWorld& world, int64_t step) {
    const FeatureFrame features = world.Take(step).features;
    return step == 6 || step == 7 ? Blind(features) : features;
  });
  EXPECT_EQ(states[7], TrackingState::kLost);
  EXPECT_EQ(states[8], TrackingState::kTracked);
  EXPECT_EQ(states[11], TrackingState::kTracked);
}

// Where everything looks alike, nothing is found by descriptors alone; but a camera that moved steadily isn't far from
// where that leads.
TEST(MapTracker, IsFoundOnItsWayAfterAMomentThoughAllLooksAlike) {
  constexpr size_t kNumKinds = 50;  // of points
  const std::vector<TrackingState> states = StatesOf(22, [](SyntheticWorld& world, int64_t step) {
    SyntheticWorld::Picture picture = world.Take(step, SyntheticWorld::Pose(0.5 * static_cast<double>(step)));
    for (size_t i = 0; i < picture.points.size(); ++i) {
      std::mt19937_64 generator(picture.points[i] % kNumKinds);
      picture.features.descriptors[i] = {generator(), generator(), generator(), generator()};
    }
    return step == 18 || step == 19 ? Blind(picture.features) : picture.features;
  });
  EXPECT_EQ(states[17], TrackingState::kTracked);
  EXPECT_EQ(states[19], TrackingState::kLost);
  EXPECT_EQ(states[20], TrackingState::kTracked);
  EXPECT_EQ(states[21], TrackingState::kTracked);
}

// A camera that suddenly goes half as far as a moment before. Where depth is measured, a jerk by few pixels is none.
TEST(MapTracker, AStepThatContradictsTheMotionIsDoubtfulIfItShowsInTheImage) {
  for (const double step_length : {1.2, 0.2}) {
    SyntheticWorld world(SensorType::kStereo, 0.3);
    MapTracker tracker{MapTrackerOptions{}};
    Mapper mapper{MapperOptions{}};
    for (int64_t step = 0; step < 15; ++step) {
      const double at = static_cast<double>(step) - (step >= 12 ? 0.5 : 0.0);
      const MapTrackingResult result = tracker.Track(world.Take(step, world.Pose(step_length * at)).features);
      EXPECT_EQ(result.pose.state, TrackingState::kTracked);
      EXPECT_EQ(result.pose.is_step_doubtful, step == 12 && step_length > 1.0) << step << ", " << step_length;
      for (const KeyframeObservation& keyframe : result.keyframes) {
        ASSERT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
      }
    }
  }
}

// One image shows the camera, which goes on steadily, behind or ahead of where it is: by what its points may err by all
// together, or by what they can't.
TEST(MapTracker, AStepThatPointsHardlyContradictGoesOnByTheMotion) {
  for (const double step_length : {0.1, 1.2}) {
    SyntheticWorld world(SensorType::kStereo, 0.2);
    MapTracker tracker{MapTrackerOptions{}};
    Mapper mapper{MapperOptions{}};
    for (int64_t step = 0; step < 13; ++step) {
      const double seen_at = static_cast<double>(step) - (step == 12 ? 0.5 : 0.0);
      const MapTrackingResult result = tracker.Track(world.Take(step, world.Pose(step_length * seen_at)).features);
      ASSERT_EQ(result.pose.state, TrackingState::kTracked);
      for (const KeyframeObservation& keyframe : result.keyframes) {
        ASSERT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
      }
      if (step < 12) continue;
      const auto distance_to = [&](double at) {
        const Rigid3 pose = world.Pose(0.0).Inverse() * world.Pose(step_length * at);
        return (result.pose.world_from_camera.translation - pose.translation).norm();
      };
      EXPECT_EQ(distance_to(12.0) < distance_to(11.5), step_length < 1.0) << step_length;
      EXPECT_LT(std::min(distance_to(11.5), distance_to(12.0)), 0.025);
    }
  }
}

// The picture's keypoints show what no map knows, but for those that `keep` chooses.
void Scramble(FeatureFrame& features, const std::function<bool(size_t keypoint)>& keep) {
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    if (!keep(i)) features.descriptors[i][0] ^= ~uint64_t{0}, features.descriptors[i][2] ^= ~uint64_t{0};
  }
}

// A tracker that begins with the map of a drive, live, while the loop closer is busy: its first image, of step 5, asks
// where it is.
class LateAnswer : public testing::Test {
 protected:
  void SetUp() override {
    Outcome drive;
    Follow(world_, 12, 3, {}, drive);
    snapshot_ = drive.mapper.map().Snapshot();
    ASSERT_THAT(tracker_.ApplyDelta(snapshot_), IsSuccess());
    const FeatureFrame first = world_.Take(0, world_.Pose(5.0)).features;
    ASSERT_TRUE(tracker_.Track(first, nullptr, true).asks_relocalization);
    ASSERT_EQ(tracker_.Track(first).pose.state, TrackingState::kLost);
    answer_ = {first.frame, KeyframeId{0}, world_.Pose(0.0).Inverse() * world_.Pose(5.0), {}, 1};
    drive.mapper.map().landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
      const Eigen::Vector3d in_camera = answer_.reference_from_camera.Inverse() * landmark.position_in_world;
      const Eigen::Vector2d pixel = first.calibration.Project(in_camera);
      for (size_t i = 0; in_camera.z() > 1.0 && i < first.keypoints.size(); ++i) {
        const Eigen::Vector2d seen(first.keypoints[i].x_px, first.keypoints[i].y_px);
        if ((seen - pixel).norm() < 1.0) answer_.seen.push_back({static_cast<int32_t>(i), id});
      }
    });
  }
  // At step 5, later.
  FeatureFrame Take(int64_t frame) { return world_.Take(frame, world_.Pose(5.0)).features; }

  SyntheticWorld world_{SensorType::kStereo, 0.3};
  MapDelta snapshot_;
  MapTracker tracker_{MapTrackerOptions{}};
  RelocalizationAnswer answer_;
};

TEST_F(LateAnswer, IsFollowedSoonAfter) {
  const PoseEstimate pose = tracker_.Track(Take(3), &answer_).pose;
  EXPECT_TRUE(pose.is_relocalized);
  EXPECT_EQ(pose.relocalized_by, answer_.frame);
}

// Before the first pose in a map that was loaded, it is waited for longer.
TEST_F(LateAnswer, IsWaitedForBeforeTheFirstPose) {
  MapTracker tracker({.max_unlocated_us = 3000000});
  ASSERT_THAT(tracker.ApplyDelta(snapshot_), IsSuccess());
  for (const int64_t frame : {0, 16, 30, 31}) {
    FeatureFrame elsewhere = Take(frame);
    Scramble(elsewhere, [](size_t /*keypoint*/) { return false; });
    const TrackingState state = tracker.Track(elsewhere).pose.state;
    EXPECT_EQ(state, frame <= 30 ? TrackingState::kLost : TrackingState::kTracked) << frame;
  }
}

// It would lead from where the camera was to what merely looks alike.
TEST_F(LateAnswer, LeavesACameraAloneThatHasBegunAnotherPart) {
  for (int64_t frame = 16; frame < 20; ++frame) {
    FeatureFrame elsewhere = Take(frame);
    Scramble(elsewhere, [](size_t /*keypoint*/) { return false; });
    const MapTrackingResult result = tracker_.Track(elsewhere, frame == 18 ? &answer_ : nullptr);
    EXPECT_EQ(result.pose.state, TrackingState::kTracked) << frame;
    EXPECT_FALSE(result.pose.is_relocalized) << frame;
    EXPECT_FALSE(result.pose.relocalized_by.valid()) << frame;
  }
}

// One car of the old place stands where the camera is after three seconds: enough inliers, in a fifth of the image.
TEST_F(LateAnswer, IsNotTakenForAnObjectThatIsSeenAgain) {
  FeatureFrame elsewhere = Take(30);
  const float end_px = 0.2F * static_cast<float>(elsewhere.calibration.width_px);
  Scramble(elsewhere, [&](size_t keypoint) { return elsewhere.keypoints[keypoint].x_px < end_px; });
  EXPECT_FALSE(tracker_.Track(elsewhere, &answer_).pose.is_relocalized);
}

TEST_F(LateAnswer, IsTakenWhereTheOldPlaceIsStillThere) {
  EXPECT_TRUE(tracker_.Track(Take(30), &answer_).pose.is_relocalized);
}

// A camera that drives, stops and stands in front of what `hide` makes of each picture from then on.
std::vector<PoseEstimate> Stand(SensorType sensor, const std::function<void(int64_t since_stop, FeatureFrame&)>& hide) {
  constexpr int64_t kStop = 20, kEnd = 50;
  SyntheticWorld world(sensor, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  std::vector<PoseEstimate> poses;
  for (int64_t frame = 0; frame < kEnd; ++frame) {
    // From half a meter a frame to none within five frames.
    const double braking = std::clamp(static_cast<double>(frame - kStop) / 5.0, 0.0, 1.0);
    const double at = static_cast<double>(std::min(frame, kStop)) + 5.0 * (braking - 0.5 * braking * braking);
    FeatureFrame features = world.Take(frame, world.Pose(at)).features;
    if (frame >= kStop + 10) hide(frame - kStop - 10, features);
    const MapTrackingResult result = tracker.Track(features);
    poses.push_back(result.pose);
    for (const KeyframeObservation& keyframe : result.keyframes) {
      EXPECT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
    }
  }
  return poses;
}

// Replaces what stands in the image left of `border_px` by points of another world, that moves to the right by half a
// meter a frame.
void PassBus(int64_t since, float border_px, FeatureFrame& features) {
  SyntheticWorld other(features.calibration.sensor, 0.3);
  const Rigid3 other_from_camera =
      other.Pose(2.0) * Rigid3{Eigen::Quaterniond::Identity(), {-0.5 * static_cast<double>(since), 0.0, 0.0}};
  FeatureFrame bus = other.Take(features.frame.value, other_from_camera).features;
  Scramble(bus, [](size_t /*keypoint*/) { return false; });
  FeatureFrame both = features;
  both.keypoints.clear();
  both.descriptors.clear();
  const auto add = [&](const FeatureFrame& from, bool is_left) {
    for (size_t i = 0; i < from.keypoints.size(); ++i) {
      if ((from.keypoints[i].x_px < border_px) != is_left) continue;
      both.keypoints.push_back(from.keypoints[i]);
      both.descriptors.push_back(from.descriptors[i]);
    }
  };
  add(features, false);
  add(bus, true);
  features = std::move(both);
}

TEST(MapTracker, IsNotCarriedAwayByWhatFillsTheImageAndMoves) {
  for (const SensorType sensor : {SensorType::kStereo, SensorType::kMono}) {
    const std::vector<PoseEstimate> poses = Stand(sensor, [](int64_t since, FeatureFrame& features) {
      const auto width_px = static_cast<float>(features.calibration.width_px);
      // It comes in from the left, fills the image, and has gone after 1.4 s.
      const float share = since < 4 ? 0.25F * static_cast<float>(since + 1) : 1.0F;
      if (since < 14) PassBus(since, share * width_px, features);
    });
    const Eigen::Vector3d standing_at = poses[29].world_from_camera.translation;
    const double way = standing_at.norm();
    int num_hidden = 0;
    for (size_t i = 30; i < poses.size(); ++i) {
      if (poses[i].state != TrackingState::kTracked) {
        ++num_hidden;
        continue;
      }
      EXPECT_LT((poses[i].world_from_camera.translation - standing_at).norm(), 0.01 * way) << i;
    }
    EXPECT_GE(num_hidden, 5);
    EXPECT_EQ(poses.back().state, TrackingState::kTracked);
    EXPECT_EQ(poses[46].state, TrackingState::kTracked) << "soon after the scene is back";
  }
}

TEST(MapTracker, WhatHidesTheSceneForLongIsTheScene) {
  const std::vector<PoseEstimate> poses = Stand(SensorType::kStereo, [](int64_t since, FeatureFrame& features) {
    features.utime_us += since > 5 ? 12'000'000 : 0;
    PassBus(0, static_cast<float>(features.calibration.width_px), features);
  });
  EXPECT_EQ(poses[31].state, TrackingState::kLost);
  EXPECT_EQ(poses.back().state, TrackingState::kTracked) << "a new part";
}

// A robot's own top, 0.6 m before its camera, has more keypoints than the scene: they say that it stands.
TEST(MapTracker, IsNotHeldByWhatMovesWithTheCamera) {
  constexpr int64_t kEnd = 40;
  SyntheticWorld world(SensorType::kRgbd, 0.3);
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  std::mt19937_64 generator(3);
  std::vector<Descriptor> top(900);
  for (Descriptor& descriptor : top) descriptor = {generator(), generator(), generator(), generator()};
  std::vector<PoseEstimate> poses;
  const auto at = [](int64_t frame) { return 0.1 * static_cast<double>(frame); };
  for (int64_t frame = 0; frame < kEnd; ++frame) {
    FeatureFrame features = world.Take(frame, world.Pose(at(frame))).features;
    for (size_t i = 0; i < top.size(); ++i) {
      const size_t row = 1 + i / 50;
      const float x_px = 10.0F + 12.0F * static_cast<float>(i % 50);
      const float y_px = static_cast<float>(features.calibration.height_px) - 8.0F * static_cast<float>(row);
      features.keypoints.push_back({.x_px = x_px, .y_px = y_px, .depth_m = 0.6F, .score = 100});
      features.descriptors.push_back(top[i]);
    }
    const MapTrackingResult result = tracker.Track(features);
    poses.push_back(result.pose);
    for (const KeyframeObservation& keyframe : result.keyframes) {
      ASSERT_THAT(tracker.ApplyDelta(mapper.Process(keyframe)), IsSuccess());
    }
  }
  // Where it is when the top has shown itself, a loop closer would say.
  const auto way = [&poses](size_t frame) { return poses[frame].world_from_camera.translation; };
  for (size_t frame = 32; frame < poses.size(); frame += 4) {
    ASSERT_EQ(poses[frame].state, TrackingState::kTracked) << frame;
    EXPECT_NEAR((way(frame) - way(frame - 2)).norm(), 0.1, 0.02) << frame;
  }
  EXPECT_TRUE(LandmarksOn(tracker.own_body(), mapper.map()).empty()) << "they have left the map";
}

}  // namespace
}  // namespace tessera
