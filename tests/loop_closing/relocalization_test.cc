// A tracker that was carried off asks where it is, and goes on in the same map; and one that begins in a map made
// before.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "loop_closing/loop_closer.h"
#include "mapping/mapper.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"
#include "tracking/map_tracker.h"

namespace tessera {
namespace {

std::shared_ptr<const Vocabulary> ShippedVocabulary() {
  static const auto vocabulary = Vocabulary::Load(TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
  return vocabulary;
}

// Tracker, mapper and loop closer, each answering at once, in a stereo world whose map is that of the first frame.
class Carried {
 public:
  explicit Carried(const MapTrackerOptions& options = {}) : tracker(options) {}

  // What the camera sees at `step` of its way, as the next frame of the sequence.
  FeatureFrame Take(int64_t step) {
    FeatureFrame features = world.Take(step).features;
    features.frame = {next_frame_};
    features.utime_us = 100000 * next_frame_++;
    return features;
  }
  void Answer(const MapTrackingResult& result) {
    for (const KeyframeObservation& keyframe : result.keyframes) Apply(mapper.Process(keyframe));
  }
  void Apply(const MapDelta& delta) {
    EXPECT_THAT(tracker.ApplyDelta(delta), IsSuccess());
    EXPECT_THAT(closer.ApplyDelta(delta), IsSuccess());
  }
  // Drives from step `first` to `last`; every frame must be tracked.
  void Drive(int64_t first, int64_t last) {
    for (int64_t step = first; step <= last; ++step) {
      const MapTrackingResult result = tracker.Track(Take(step));
      ASSERT_EQ(result.pose.state, TrackingState::kTracked) << step;
      Answer(result);
    }
  }
  RelocalizationAnswer Ask(const FeatureFrame& features) const {
    return closer.Relocalize({features, tracker.last_keyframe()});
  }
  double Error(const PoseEstimate& pose, int64_t step) const {
    const Rigid3 truth = world.Pose(0.0).Inverse() * world.Pose(static_cast<double>(step));
    return (pose.world_from_camera.translation - truth.translation).norm();
  }

  SyntheticWorld world{SensorType::kStereo, 0.3};
  MapTracker tracker;
  Mapper mapper{MapperOptions{}};
  LoopCloser closer{ShippedVocabulary(), {}};

 private:
  int64_t next_frame_ = 0;
};

constexpr int64_t kFar = 44;  // steps: from there, nothing of the beginning is in sight

// The map is so small that a tracker knows nearly all of it as what is around the last frame; this one looks less far.
MapTrackerOptions ShortSighted() {
  MapTrackerOptions options;
  options.search.max_local_keyframes = 2;
  options.keyframes.min_share_with_depth = 0.75;  // and these are near one another
  return options;
}

TEST(Relocalization, ATrackerThatWasCarriedAwayAsksAndContinuesInTheSameMap) {
  Carried run(ShortSighted());
  run.Drive(0, kFar);
  const FeatureFrame features = run.Take(2);
  const MapTrackingResult asking = run.tracker.Track(features, nullptr, true);
  ASSERT_TRUE(asking.asks_relocalization);
  EXPECT_TRUE(asking.keyframes.empty());
  const RelocalizationAnswer answer = run.Ask(features);
  ASSERT_TRUE(answer.reference.valid());
  const MapTrackingResult result = run.tracker.Track(features, &answer, false);
  EXPECT_FALSE(result.asks_relocalization);
  ASSERT_EQ(result.pose.state, TrackingState::kTracked);
  EXPECT_TRUE(result.pose.is_relocalized);
  EXPECT_EQ(result.pose.relocalized_by, features.frame);
  EXPECT_LT(run.Error(result.pose, 2), 0.05);
  run.Answer(result);
  const int64_t num_keyframes = run.mapper.map().keyframes().size();
  for (int64_t step = 3; step < 12; ++step) {
    const MapTrackingResult next = run.tracker.Track(run.Take(step), nullptr, true);
    ASSERT_EQ(next.pose.state, TrackingState::kTracked) << step;
    EXPECT_FALSE(next.pose.is_relocalized);
    EXPECT_FALSE(next.pose.relocalized_by.valid());
    EXPECT_LT(run.Error(next.pose, step), 0.05);
    run.Answer(next);
  }
  EXPECT_LE(run.mapper.map().keyframes().size(), num_keyframes + 4) << "the place is known already";
}

TEST(Relocalization, WithoutAnAnswerTheFrameIsLost) {
  Carried run(ShortSighted());
  run.Drive(0, kFar);
  const FeatureFrame features = run.Take(2);
  ASSERT_TRUE(run.tracker.Track(features, nullptr, true).asks_relocalization);
  const RelocalizationAnswer nowhere{.frame = features.frame};
  const MapTrackingResult result = run.tracker.Track(features, &nowhere, false);
  EXPECT_EQ(result.pose.state, TrackingState::kLost);
  EXPECT_FALSE(result.pose.relocalized_by.valid());
  EXPECT_FALSE(result.asks_relocalization);
}

// The tracker checks what it is told against its own map.
TEST(Relocalization, AnAnswerThatTheMapContradictsIsRejected) {
  Carried run(ShortSighted());
  run.Drive(0, kFar);
  const FeatureFrame features = run.Take(2);
  ASSERT_TRUE(run.tracker.Track(features, nullptr, true).asks_relocalization);
  RelocalizationAnswer answer = run.Ask(features);
  ASSERT_TRUE(answer.reference.valid());
  std::mt19937 generator(1);
  std::vector<LandmarkId> landmarks;
  for (const SeenLandmark& seen : answer.seen) landmarks.push_back(seen.landmark);
  std::shuffle(landmarks.begin(), landmarks.end(), generator);
  for (size_t i = 0; i < landmarks.size(); ++i) answer.seen[i].landmark = landmarks[i];
  EXPECT_EQ(run.tracker.Track(features, &answer, false).pose.state, TrackingState::kLost);
  RelocalizationAnswer unknown = run.Ask(features);
  unknown.reference = {12345};
  const FeatureFrame next = run.Take(3);
  ASSERT_TRUE(run.tracker.Track(next, nullptr, true).asks_relocalization);
  EXPECT_EQ(run.tracker.Track(next, &unknown, false).pose.state, TrackingState::kLost);
}

// Live: the answer comes some frames later, and is about the frame that asked.
TEST(Relocalization, ALateAnswerPlacesTheFramesAfterTheOneThatAsked) {
  Carried run(ShortSighted());
  run.Drive(0, kFar);
  const FeatureFrame asked = run.Take(2);
  ASSERT_TRUE(run.tracker.Track(asked, nullptr, true).asks_relocalization);
  EXPECT_EQ(run.tracker.Track(asked).pose.state, TrackingState::kLost);
  EXPECT_EQ(run.tracker.Track(run.Take(3)).pose.state, TrackingState::kLost);
  const RelocalizationAnswer answer = run.Ask(asked);
  const FeatureFrame now = run.Take(4);
  const MapTrackingResult result = run.tracker.Track(now, &answer, false);
  ASSERT_EQ(result.pose.state, TrackingState::kTracked);
  EXPECT_EQ(result.pose.frame, now.frame);
  EXPECT_TRUE(result.pose.is_relocalized);
  EXPECT_EQ(result.pose.relocalized_by, asked.frame);
  EXPECT_LT(run.Error(result.pose, 4), 0.05);
  RelocalizationAnswer stale = answer;
  stale.frame = {3};  // of a frame that did not ask
  EXPECT_FALSE(run.tracker.Track(run.Take(5), &stale, false).pose.relocalized_by.valid());
}

TEST(Relocalization, BlackImagesAskForNothing) {
  Carried run;
  run.Drive(0, 5);
  FeatureFrame black = run.Take(6);
  black.keypoints.clear();
  black.descriptors.clear();
  const MapTrackingResult result = run.tracker.Track(black, nullptr, true);
  EXPECT_FALSE(result.asks_relocalization);
  EXPECT_EQ(result.pose.state, TrackingState::kLost);
  const MapTrackingResult next = run.tracker.Track(run.Take(6), nullptr, true);
  EXPECT_FALSE(next.asks_relocalization) << "it is where it was";
  ASSERT_EQ(next.pose.state, TrackingState::kTracked);
  EXPECT_TRUE(next.pose.is_relocalized);
  EXPECT_FALSE(next.pose.relocalized_by.valid());
}

// The map of a run, as it comes from a file.
MapDelta MadeMap(KeyframeId* last) {
  Carried run;
  run.Drive(0, 20);
  *last = run.tracker.last_keyframe();
  return run.mapper.map().Snapshot();
}

TEST(Relocalization, LocalizingOnlyMakesNoKeyframes) {
  KeyframeId last;
  const MapDelta made = MadeMap(&last);
  MapTrackerOptions options;
  options.makes_keyframes = false;
  Carried run(options);
  run.Apply(made);
  const FeatureFrame features = run.Take(4);
  ASSERT_TRUE(run.tracker.Track(features, nullptr, true).asks_relocalization) << "it never was anywhere";
  const RelocalizationAnswer answer = run.Ask(features);
  const MapTrackingResult first = run.tracker.Track(features, &answer, false);
  ASSERT_EQ(first.pose.state, TrackingState::kTracked);
  EXPECT_TRUE(first.pose.is_relocalized);
  EXPECT_TRUE(first.keyframes.empty());
  for (int64_t step = 5; step < 15; ++step) {
    const MapTrackingResult result = run.tracker.Track(run.Take(step), nullptr, true);
    ASSERT_EQ(result.pose.state, TrackingState::kTracked) << step;
    EXPECT_TRUE(result.keyframes.empty());
    EXPECT_LT(run.Error(result.pose, step), 0.05);
  }
  // However long it is lost, no part begins.
  for (int i = 0; i < 30; ++i) {
    const FeatureFrame elsewhere = run.Take(60);
    const RelocalizationAnswer nowhere{.frame = elsewhere.frame};
    const MapTrackingResult result = run.tracker.Track(elsewhere, &nowhere, false);
    EXPECT_EQ(result.pose.state, TrackingState::kLost);
    EXPECT_TRUE(result.keyframes.empty());
  }
}

TEST(Relocalization, ALoadedMapIsContinued) {
  KeyframeId last;
  const MapDelta made = MadeMap(&last);
  MapTrackerOptions options;
  options.keyframes.min_share_with_depth = 0.65;  // some more keyframes of a short way
  Carried run(options);
  ASSERT_THAT(run.mapper.Load(made), IsSuccess());
  run.Apply(made);
  EXPECT_EQ(run.tracker.last_keyframe(), last);
  const FeatureFrame features = run.Take(15);
  ASSERT_TRUE(run.tracker.Track(features, nullptr, true).asks_relocalization);
  const RelocalizationAnswer answer = run.Ask(features);
  std::vector<KeyframeId> added;
  for (int64_t step = 15; step < 35; ++step) {
    const MapTrackingResult result =
        step == 15 ? run.tracker.Track(features, &answer, false) : run.tracker.Track(run.Take(step));
    ASSERT_EQ(result.pose.state, TrackingState::kTracked) << step;
    EXPECT_LT(run.Error(result.pose, step), 0.1) << step;
    for (const KeyframeObservation& keyframe : result.keyframes) added.push_back(keyframe.id);
    run.Answer(result);
  }
  ASSERT_GT(added.size(), 2U) << "it left what the map knew";
  for (size_t i = 0; i < added.size(); ++i) EXPECT_EQ(added[i].value, last.value + 1 + static_cast<int64_t>(i));
  EXPECT_EQ(run.tracker.map().hash(), run.mapper.map().hash());
}

}  // namespace
}  // namespace tessera
