#include "evaluation/run_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "support/matchers.h"

namespace tessera {
namespace {

PoseEstimate Pose(int64_t frame, TrackingState state, double x = 0.0) {
  PoseEstimate pose;
  pose.frame = FrameId{frame};
  pose.utime_us = 100'000 * frame;
  pose.captured_us = 5'000'000 + 10'000 * frame;
  pose.state = state;
  pose.world_from_camera.translation = {x, 0.0, 0.0};
  pose.num_landmarks = static_cast<int32_t>(100 + frame);
  return pose;
}

// A delta that the record's map takes, with the hash that it leads to.
void Apply(RunRecord& record, MapDelta delta) {
  Map trial = record.map();
  delta.number = trial.next_delta();
  (void)trial.Apply(delta);  // complains of the hash, which is found by it
  delta.hash = trial.hash();
  EXPECT_THAT(record.ApplyDelta(delta), IsSuccess());
}

MapDelta NewKeyframe(int64_t id, int64_t parent, int64_t frame, const Rigid3& world_from_camera) {
  auto features = std::make_shared<FeatureFrame>();
  features->frame = FrameId{frame};
  features->utime_us = 100'000 * frame;
  return {.new_keyframes = {{{id}, {parent}, world_from_camera, std::move(features)}}};
}

Rigid3 At(double x) { return {Eigen::Quaterniond::Identity(), {x, 0.0, 0.0}}; }

constexpr auto kInitializing = TrackingState::kInitializing;
constexpr auto kTracked = TrackingState::kTracked;
constexpr auto kLost = TrackingState::kLost;

RunRecord RecordOf(const std::vector<TrackingState>& states, int64_t first_frame = 0) {
  RunRecord record;
  for (size_t i = 0; i < states.size(); ++i) {
    const int64_t frame = first_frame + static_cast<int64_t>(i);
    record.AddPose(Pose(frame, states[i], static_cast<double>(frame)), 5'030'000 + 20'000 * frame);
  }
  return record;
}

TEST(RunRecord, CountsFramesByWhatBecameOfThem) {
  RunRecord record =
      RecordOf({kInitializing, kInitializing, kTracked, kLost, kLost, kTracked, kTracked, kLost, kInitializing});
  record.SetEnd(12, 3);
  const FrameCounts counts = record.Counts();
  EXPECT_EQ(counts.frames, 12);
  EXPECT_EQ(counts.initializing, 2);
  EXPECT_EQ(counts.tracked, 3);
  EXPECT_EQ(counts.lost, 4);
  EXPECT_EQ(counts.dropped, 3);
  EXPECT_EQ(counts.tracking_failures, 2);
}

// Frames as in RecordOf, of which some were found again.
FrameCounts CountsOf(const std::vector<TrackingState>& states, const std::vector<int64_t>& relocalized) {
  RunRecord record;
  for (size_t i = 0; i < states.size(); ++i) {
    const auto frame = static_cast<int64_t>(i);
    PoseEstimate pose = Pose(frame, states[i]);
    pose.is_relocalized = std::find(relocalized.begin(), relocalized.end(), frame) != relocalized.end();
    record.AddPose(pose, 5'000'000 + frame);
  }
  return record.Counts();
}

TEST(RunRecord, FramesOfTheSourceThatLeftNoTraceAreMissing) {
  RunRecord record;
  for (const int64_t frame : {10, 11, 13}) record.AddPose({.frame = {frame}}, 0);
  record.SetSource(10, 15);
  EXPECT_EQ(record.Counts().missing, 0) << "more may come";
  record.SetEnd(15, 1);
  EXPECT_EQ(record.Counts().missing, 1);
  record.SetEnd(15, 2);
  EXPECT_EQ(record.Counts().missing, 0);
}

TEST(RunRecord, ACameraThatWasStartedAgainBeganWithTheFirstPose) {
  RunRecord record;
  for (int64_t frame = 0; frame < 20; ++frame) record.AddPose({.frame = {frame}}, 0);
  record.SetSource(12, 20);
  record.SetEnd(20, 0);
  EXPECT_EQ(record.Counts().missing, 0);
}

TEST(RunRecord, FramesBeforeTheFirstPoseAreMissedToo) {
  RunRecord record;
  record.AddPose({.frame = {3}}, 0);
  record.SetSource(0, 4);
  record.SetEnd(4, 1);
  EXPECT_EQ(record.Counts().missing, 2);
}

TEST(RunRecord, CountsLossesAndWhereTheCameraWasFoundAgain) {
  const FrameCounts blinded = CountsOf({kTracked, kLost, kLost, kTracked, kTracked}, {3});
  EXPECT_EQ(blinded.tracking_failures, 1);
  EXPECT_EQ(blinded.relocalizations, 1);
  EXPECT_EQ(blinded.lost, 2);
  const FrameCounts carried = CountsOf({kTracked, kTracked, kTracked, kTracked}, {2});
  EXPECT_EQ(carried.tracking_failures, 1) << "lost and found within one frame";
  EXPECT_EQ(carried.relocalizations, 1);
  EXPECT_EQ(carried.lost, 0);
  const FrameCounts new_part = CountsOf({kTracked, kLost, kTracked, kTracked}, {});
  EXPECT_EQ(new_part.tracking_failures, 1);
  EXPECT_EQ(new_part.relocalizations, 0) << "another part of the map began";
  const FrameCounts loaded = CountsOf({kLost, kTracked, kTracked}, {1});
  EXPECT_EQ(loaded.tracking_failures, 0) << "it was not tracked before";
  EXPECT_EQ(loaded.relocalizations, 1);
}

// A loop of mono enlarges what stands around a keyframe, and the way that frames are from it.
TEST(RunRecord, FinalPosesGrowWithTheirSurroundings) {
  RunRecord record;
  MapDelta delta = NewKeyframe(0, -1, 0, At(1.0));
  Apply(record, delta);
  PoseEstimate pose = Pose(3, kTracked, 3.0);
  pose.reference_keyframe = {0};
  pose.reference_from_camera = At(2.0);
  record.AddPose(pose, 5'000'000);
  EXPECT_EQ(record.Trajectory().at(0).world_from_camera.translation.x(), 3.0);
  Apply(record, {.moved_keyframes = {{{0}, At(10.0), 1.5}}});
  EXPECT_EQ(record.Trajectory().at(0).world_from_camera.translation.x(), 13.0);
}

TEST(RunRecord, WithoutAnEndTheStagesTellOfDroppedFrames) {
  RunRecord record = RecordOf({kTracked});
  record.SetStage("camera", {.num_dropped = 1});
  record.SetStage("dispatcher", {.num_dropped = 2});
  record.SetStage("dispatcher", {.num_dropped = 5});
  EXPECT_EQ(record.Counts().dropped, 6);
  EXPECT_EQ(RunRecord().Counts().frames, 0);
}

TEST(RunRecord, MeasuresPoseTimeAndLatency) {
  const std::vector<FrameRecord> frames = RecordOf({kTracked, kTracked}).Frames();
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_FALSE(frames[0].pose_time_ms);
  EXPECT_DOUBLE_EQ(*frames[1].pose_time_ms, 20.0);
  EXPECT_DOUBLE_EQ(*frames[0].latency_ms, 30.0);
  EXPECT_DOUBLE_EQ(*frames[1].latency_ms, 40.0);
}

TEST(RunRecord, FinalPosesFollowTheirKeyframesAlsoWhenTheseAreGone) {
  RunRecord record;
  PoseEstimate pose = Pose(3, kTracked, 5.0);
  pose.reference_keyframe = KeyframeId{1};
  pose.reference_from_camera.translation = {0.0, 0.0, 2.0};
  record.AddPose(pose, 1);
  record.AddPose(Pose(4, kTracked, 6.0), 2);  // without a reference: stays as it was
  Apply(record, NewKeyframe(0, -1, 1, At(0.0)));
  Rigid3 turned = At(10.0);
  turned.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()));
  Apply(record, NewKeyframe(1, 0, 2, turned));
  const std::vector<StampedPose> trajectory = record.Trajectory();
  ASSERT_EQ(trajectory.size(), 2U);
  EXPECT_EQ(trajectory[0].frame.value, 3);
  EXPECT_EQ(trajectory[0].utime_us, 300'000);
  EXPECT_LT((trajectory[0].world_from_camera.translation - Eigen::Vector3d(12.0, 0.0, 0.0)).norm(), 1e-12);
  EXPECT_EQ(trajectory[1].world_from_camera.translation.x(), 6.0);
  EXPECT_EQ(record.LiveTrajectory()[0].world_from_camera.translation.x(), 5.0);
  EXPECT_EQ(record.Keyframes().size(), 2U);
  // The keyframe is culled, and later its parent moves: what was relative to it moves along.
  Apply(record, {.removed_keyframes = {{1}}});
  Apply(record, {.moved_keyframes = {{{0}, At(1.0)}}});
  EXPECT_LT((record.Trajectory()[0].world_from_camera.translation - Eigen::Vector3d(13.0, 0.0, 0.0)).norm(), 1e-12);
  EXPECT_EQ(record.Keyframes().size(), 1U);
}

TEST(RunRecord, FramesBelongToThePartThatPlacesThem) {
  RunRecord record = RecordOf({kInitializing});
  const auto track = [&](int64_t frame, int64_t reference) {
    PoseEstimate pose = Pose(frame, kTracked);
    pose.reference_keyframe = {reference};
    record.AddPose(pose, frame);
  };
  EXPECT_TRUE(record.Parts().empty());
  Apply(record, NewKeyframe(0, -1, 1, At(0.0)));
  Apply(record, NewKeyframe(1, -1, 5, At(0.0)));
  Apply(record, NewKeyframe(2, 1, 6, At(1.0)));
  Apply(record, NewKeyframe(3, 0, 7, At(1.0)));
  Apply(record, {.removed_keyframes = {{3}}});
  Apply(record, NewKeyframe(4, -1, 8, At(1.0)));
  track(1, 0);
  track(2, 0);
  track(5, 1);
  track(6, 2);
  track(7, 3);  // was recognized in the first part, by a keyframe that is gone
  const std::vector<PartRecord> parts = record.Parts();
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(parts[0].num_keyframes, 1);
  EXPECT_EQ(parts[0].num_frames, 3);
  EXPECT_EQ(parts[0].first->frame.value, 1);
  EXPECT_EQ(parts[0].last->frame.value, 7);
  EXPECT_FALSE(parts[0].is_main);
  EXPECT_EQ(parts[1].num_keyframes, 2);
  EXPECT_EQ(parts[1].first->utime_us, 500'000);
  EXPECT_EQ(parts[1].last->utime_us, 600'000);
  EXPECT_TRUE(parts[1].is_main);
  EXPECT_FALSE(parts[2].first.has_value()) << "no frame";
  EXPECT_FALSE(parts[2].is_main);
}

TEST(RunRecord, EveryFrameOfTheSourceHasARow) {
  // Frames 10 .. 17 of a source; 12 and 17 were dropped on the way, 10 is before the map, 14 is lost.
  RunRecord record;
  for (const int64_t frame : {10, 11, 13, 14, 15, 16}) {
    const TrackingState state = frame == 10 ? kInitializing : frame == 14 ? kLost : kTracked;
    record.AddPose(Pose(frame, state, static_cast<double>(frame)), frame);
  }
  record.SetEnd(18, 2);
  std::vector<double> xs;
  for (const Rigid3& pose : record.PosePerFrame()) {
    xs.push_back(pose.translation.x());
  }
  EXPECT_EQ(xs, (std::vector<double>{0.0, 11.0, 11.0, 13.0, 13.0, 15.0, 16.0, 16.0}));
}

TEST(RunRecord, AFirstFrameThatWasDroppedHasARowToo) {
  RunRecord record = RecordOf({kTracked, kTracked}, 1);
  record.SetEnd(3, 1);
  EXPECT_EQ(record.PosePerFrame().size(), 3U);
  EXPECT_TRUE(RunRecord().PosePerFrame().empty());
}

TEST(RunRecord, FramesThatWereDroppedAtTheEndHaveRowsToo) {
  RunRecord record;
  for (int64_t frame = 0; frame < 3; ++frame) record.AddPose({.frame = {frame}}, 0);
  record.SetSource(0, 60);
  record.SetEnd(3, 57);
  EXPECT_EQ(record.PosePerFrame().size(), 60U);
  EXPECT_EQ(record.Counts().missing, 0);
}

TEST(RunRecord, WhatComesTwiceCountsOnce) {
  RunRecord record = RecordOf({kTracked, kTracked});
  const std::string trajectory_hash = record.TrajectorySha256();
  record.AddPose(Pose(1, kLost, 99.0), 9'000'000);
  EXPECT_EQ(record.Counts().tracked, 2);
  EXPECT_EQ(record.TrajectorySha256(), trajectory_hash);
}

TEST(RunRecord, TheHashDependsOnEveryBitButNotOnTheOrderOfArrivalNorOnTimes) {
  RunRecord forward, backward;
  for (int i = 0; i < 3; ++i) {
    forward.AddPose(Pose(i, kTracked, i), 100 + i);
    PoseEstimate late = Pose(2 - i, kTracked, 2 - i);
    late.captured_us = 1;
    late.map_wait_us = 77;
    backward.AddPose(late, 500 + i);
  }
  EXPECT_EQ(forward.TrajectorySha256(), backward.TrajectorySha256());

  RunRecord moved = RecordOf({kTracked, kTracked}), same = RecordOf({kTracked, kTracked});
  EXPECT_EQ(moved.TrajectorySha256(), same.TrajectorySha256());
  moved.AddPose(Pose(2, kTracked, 2.0), 1);
  same.AddPose(Pose(2, kTracked, std::nextafter(2.0, 3.0)), 1);
  EXPECT_NE(moved.TrajectorySha256(), same.TrajectorySha256());
}

}  // namespace
}  // namespace tessera
