#include "tracking/tracker_session.h"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <random>

#include "map/map_editor.h"
#include "mapping/mapper.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

using State = TrackerSession::State;

MapTrackerOptions Options() {
  MapTrackerOptions options;
  options.keyframes.min_share_with_depth = 0.65;  // some more keyframes of a short way
  return options;
}

// A session with the mapper that answers it, whose deltas come only when they are delivered.
class Stack {
 public:
  explicit Stack(std::unique_ptr<TrackerTime> time, bool begins_with_map = false)
      : session(Options(), std::move(time), begins_with_map) {}

  // Frame `step` of a drive comes, and all that can be tracked is. Returns the state after it.
  State Frame(int64_t step) { return Receive(world.Take(step).features); }
  // One that shows nothing known.
  State BlindFrame(int64_t step) {
    FeatureFrame features = world.Take(step).features;
    std::mt19937_64 generator(static_cast<uint64_t>(step));
    for (Descriptor& descriptor : features.descriptors) {
      descriptor = {generator(), generator(), generator(), generator()};
    }
    return Receive(std::move(features));
  }
  State Receive(FeatureFrame features) {
    session.Receive(std::move(features));
    return Run();
  }
  State DeliverDeltas() {
    for (; num_delivered < deltas.size(); ++num_delivered) EXPECT_TRUE(session.Receive(deltas[num_delivered]));
    return Run();
  }
  State Answer(int64_t frame) {
    RelocalizationAnswer answer;  // "not found"
    answer.frame = {frame};
    session.Receive(answer);
    return Run();
  }
  State Run() {
    while (session.state() == State::kReady) Note(session.Advance());
    return session.state();
  }
  void Note(TrackerActions actions) {
    for (TrackerAction& action : actions) {
      std::visit(Overloaded{[&](PoseEstimate& pose) { poses[pose.frame.value] = pose; },
                            [&](KeyframeObservation& keyframe) {
                              deltas.push_back(std::make_shared<const MapDelta>(mapper.Process(keyframe)));
                            },
                            [&](RelocalizationRequest& request) { questions.push_back(request); },
                            [&](EndOfStream& end) { ends.push_back(end); },
                            [&](RejectMap& reject) { rejections.push_back(reject.reason); },
                            [&](Fail& fail) { failures.push_back(fail); }, [&](Finish&) { has_finished = true; }},
                 action);
    }
  }

  SyntheticWorld world{SensorType::kStereo, 0.3};
  TrackerSession session;
  Mapper mapper{MapperOptions{}};
  std::vector<TrackerTime::Delta> deltas;  // that the mapper made
  size_t num_delivered = 0;
  std::map<int64_t, PoseEstimate> poses;  // by frame
  std::vector<RelocalizationRequest> questions;
  std::vector<EndOfStream> ends;
  std::vector<std::string> rejections;
  std::vector<Fail> failures;
  bool has_finished = false;
};

std::unique_ptr<TrackerTime> Logical(int64_t map_delay_frames = 3) {
  return std::make_unique<LogicalTime>(map_delay_frames);
}

// The map of a drive that was made before.
TrackerTime::Delta SavedMap() {
  Stack before(std::make_unique<LiveTime>());
  for (int64_t step = 0; step < 5; ++step) before.Frame(step);
  return std::make_shared<const MapDelta>(before.mapper.map().Snapshot());
}

TEST(TrackerSession, InLogicalTimeAFrameWaitsForTheDeltasThatItMustSee) {
  Stack stack(Logical(2));
  EXPECT_EQ(stack.session.state(), State::kAwaitsFrame);
  EXPECT_EQ(stack.Frame(0), State::kAwaitsFrame);
  ASSERT_EQ(stack.deltas.size(), 1U) << "the first stereo frame is a keyframe";
  EXPECT_EQ(stack.Frame(1), State::kAwaitsFrame) << "frame 1 need not see the answer to frame 0";
  EXPECT_EQ(stack.Frame(2), State::kAwaitsDeltas);
  EXPECT_EQ(stack.session.num_waiting(), 1U);
  EXPECT_FALSE(stack.poses.contains(2));
  EXPECT_EQ(stack.DeliverDeltas(), State::kAwaitsFrame);
  EXPECT_EQ(stack.poses.at(1).num_deltas, 0);
  EXPECT_EQ(stack.poses.at(2).num_deltas, 1);
  EXPECT_FALSE(stack.poses.at(2).is_live);
}

TEST(TrackerSession, InLogicalTimeItDoesNotMatterWhenDeltasCome) {
  Stack early(Logical()), late(Logical());
  for (int64_t step = 0; step < 12; ++step) {
    early.Frame(step);
    early.DeliverDeltas();
    if (late.Frame(step) == State::kAwaitsDeltas) late.DeliverDeltas();
  }
  ASSERT_EQ(early.poses.size(), 12U);
  ASSERT_EQ(late.poses.size(), 12U);
  for (const auto& [frame, pose] : early.poses) {
    EXPECT_EQ(late.poses.at(frame).num_deltas, pose.num_deltas) << frame;
    EXPECT_EQ(late.poses.at(frame).world_from_camera.translation, pose.world_from_camera.translation) << frame;
  }
}

TEST(TrackerSession, LiveNeverWaits) {
  Stack stack(std::make_unique<LiveTime>());
  for (int64_t step = 0; step < 6; ++step) EXPECT_EQ(stack.Frame(step), State::kAwaitsFrame);
  EXPECT_EQ(stack.poses.at(5).num_deltas, 0) << "no delta came";
  stack.DeliverDeltas();
  stack.Frame(6);
  EXPECT_EQ(stack.poses.at(6).num_deltas, static_cast<int64_t>(stack.num_delivered)) << "all are seen at once";
  EXPECT_TRUE(stack.poses.at(6).is_live);
}

TEST(TrackerSession, AReplayFollowsTheRecordedSteps) {
  Stack live(std::make_unique<LiveTime>());
  RecordedSteps recorded{.is_live = true};
  for (int64_t step = 0; step < 14; ++step) {
    live.Frame(step);
    if (step % 5 == 4) live.DeliverDeltas();
    recorded.steps[{step}] = live.poses.at(step).num_deltas;
  }
  ASSERT_GT(recorded.steps.at({13}), 1);
  Stack replay(std::make_unique<ReplayTime>(recorded));
  for (int64_t step = 0; step < 14; ++step) {
    if (replay.Frame(step) == State::kAwaitsDeltas) replay.DeliverDeltas();
    ASSERT_TRUE(replay.poses.contains(step));
    EXPECT_EQ(replay.poses.at(step).num_deltas, live.poses.at(step).num_deltas) << step;
    EXPECT_EQ(replay.poses.at(step).world_from_camera.translation, live.poses.at(step).world_from_camera.translation);
  }
}

TEST(TrackerSession, ALostFrameAsksAndWaitsForTheAnswerInLogicalTime) {
  Stack stack(Logical());
  for (int64_t step = 0; step < 4; ++step) {
    stack.Frame(step);
    stack.DeliverDeltas();
  }
  EXPECT_EQ(stack.BlindFrame(4), State::kAwaitsAnswer);
  ASSERT_EQ(stack.questions.size(), 1U);
  EXPECT_EQ(stack.questions.front().features.frame, FrameId{4});
  EXPECT_EQ(stack.questions.front().last_keyframe.value + 1, static_cast<int64_t>(stack.deltas.size()));
  EXPECT_NE(stack.session.open_question(), nullptr) << "to be sent again";
  EXPECT_EQ(stack.Frame(5), State::kAwaitsAnswer) << "frames keep their order";
  EXPECT_FALSE(stack.poses.contains(4));
  EXPECT_EQ(stack.Answer(4), State::kAwaitsFrame);
  EXPECT_EQ(stack.session.open_question(), nullptr);
  EXPECT_EQ(stack.poses.at(4).state, TrackingState::kLost);
  EXPECT_EQ(stack.poses.at(5).state, TrackingState::kTracked);
  EXPECT_EQ(stack.questions.size(), 1U) << "a frame asks once";
}

TEST(TrackerSession, LiveALostFrameAsksAndDoesNotWait) {
  Stack stack(std::make_unique<LiveTime>());
  for (int64_t step = 0; step < 4; ++step) {
    stack.Frame(step);
    stack.DeliverDeltas();
  }
  EXPECT_EQ(stack.BlindFrame(4), State::kAwaitsFrame);
  EXPECT_EQ(stack.poses.at(4).state, TrackingState::kLost);
  EXPECT_EQ(stack.BlindFrame(5), State::kAwaitsFrame);
  EXPECT_EQ(stack.questions.size(), 1U) << "no second question while one is open";
  stack.Answer(4);
  stack.BlindFrame(6);
  EXPECT_EQ(stack.questions.size(), 1U) << "the frame that takes the answer does not ask";
  stack.BlindFrame(7);
  EXPECT_EQ(stack.questions.size(), 2U);
}

TEST(TrackerSession, FramesWaitForAMapThatIsLoaded) {
  Stack stack(Logical(), true);
  EXPECT_EQ(stack.Frame(5), State::kAwaitsSnapshot);
  EXPECT_TRUE(stack.session.Receive(SavedMap()));
  EXPECT_EQ(stack.Run(), State::kAwaitsAnswer) << "now it asks where in that map it is";
  EXPECT_EQ(stack.questions.size(), 1U);
}

TEST(TrackerSession, FramesWaitForASnapshotWhenADeltaDoesNotFit) {
  Stack stack(Logical(1));
  stack.Frame(0);
  auto damaged = std::make_shared<MapDelta>(*stack.deltas.at(0));
  damaged->hash += 1;
  EXPECT_TRUE(stack.session.Receive(damaged)) << "it is held until a frame must see it";
  EXPECT_EQ(stack.Frame(1), State::kAwaitsSnapshot);
  EXPECT_EQ(stack.rejections.size(), 1U);
  EXPECT_FALSE(stack.poses.contains(1));
  auto snapshot = std::make_shared<MapDelta>(stack.mapper.map().Snapshot());
  snapshot->hash += 1;
  EXPECT_FALSE(stack.session.Receive(snapshot));
  EXPECT_EQ(stack.Run(), State::kAwaitsSnapshot) << "that one does not fit either";
  EXPECT_TRUE(stack.session.Receive(std::make_shared<const MapDelta>(stack.mapper.map().Snapshot())));
  EXPECT_EQ(stack.Run(), State::kAwaitsFrame);
  EXPECT_EQ(stack.poses.at(1).state, TrackingState::kTracked);
  EXPECT_EQ(stack.poses.at(1).num_deltas, 1);
}

TEST(TrackerSession, AMapOfAnotherCameraIsRefusedForGood) {
  Stack stack(Logical(), true);
  ASSERT_TRUE(stack.session.Receive(SavedMap()));
  FeatureFrame other = stack.world.Take(0).features;
  other.calibration.fx_px += 1.0;
  EXPECT_EQ(stack.Receive(other), State::kFailed);
  ASSERT_EQ(stack.failures.size(), 1U);
  EXPECT_TRUE(stack.failures.front().is_user_error);
  other.frame = {1};
  EXPECT_EQ(stack.Receive(other), State::kFailed);
  EXPECT_TRUE(stack.session.Advance().empty());
  EXPECT_TRUE(stack.poses.empty());
}

TEST(TrackerSession, AMapOfAnotherLensFitsTheCameraThatItCorrectsAndNoOther) {
  Map map;
  ASSERT_TRUE(map.Apply(*SavedMap()));
  MapEditor editor(map);
  editor.ChangeLens({490.0, 490.0, 0.01});
  (void)editor.Finish(map.answered());
  for (const double fx_px : {500.0, 600.0}) {
    Stack stack(Logical(), true);
    ASSERT_TRUE(stack.session.Receive(std::make_shared<const MapDelta>(map.Snapshot())));
    FeatureFrame features = stack.world.Take(0).features;
    features.calibration.fx_px = features.calibration.fy_px = fx_px;
    EXPECT_EQ(stack.Receive(features) == State::kFailed, fx_px == 600.0);
  }
}

TEST(TrackerSession, ARepeatedFrameIsIgnored) {
  Stack stack(Logical());
  stack.Frame(0);
  stack.Frame(1);
  EXPECT_EQ(stack.Frame(0), State::kAwaitsFrame);
  EXPECT_EQ(stack.session.num_waiting(), 0U);
  EXPECT_EQ(stack.poses.size(), 2U);
}

TEST(TrackerSession, TheEndComesAfterTheLastFrame) {
  Stack stack(Logical());
  stack.Frame(0);
  stack.Note(stack.session.Receive(EndOfStream{.num_frames = 2, .num_dropped = 3}));
  EXPECT_FALSE(stack.has_finished);
  EXPECT_EQ(stack.Frame(1), State::kFinished);
  EXPECT_TRUE(stack.has_finished);
  ASSERT_EQ(stack.ends.size(), 1U);
  EXPECT_EQ(stack.ends.front().num_frames, 2);
  EXPECT_EQ(stack.ends.front().num_dropped, 3);
  EXPECT_EQ(stack.ends.front().num_values, static_cast<int64_t>(stack.deltas.size())) << "keyframes";
}

TEST(TrackerSession, TheEndMayComeLast) {
  Stack stack(Logical());
  stack.Frame(0);
  stack.Note(stack.session.Receive(EndOfStream{.num_frames = 1}));
  EXPECT_TRUE(stack.has_finished);
  EXPECT_EQ(stack.session.state(), State::kFinished);
  stack.Note(stack.session.Receive(EndOfStream{.num_frames = 1}));
  EXPECT_EQ(stack.ends.size(), 1U) << "said once";
}

}  // namespace
}  // namespace tessera
