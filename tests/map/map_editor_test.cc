#include "map/map_editor.h"

#include <gtest/gtest.h>

#include <random>

#include "support/matchers.h"

namespace tessera {
namespace {

std::shared_ptr<const FeatureFrame> Features(int64_t frame) {
  auto features = std::make_shared<FeatureFrame>();
  features->frame = {frame};
  features->keypoints.resize(60);
  features->descriptors.resize(60);
  return features;
}

// First keypoint of the keyframe that sees nothing; -1 if all do.
int32_t FreeKeypoint(const Map& map, KeyframeId id) {
  const std::vector<LandmarkId>& landmarks = map.FindKeyframe(id)->landmarks;
  for (size_t i = 0; i < landmarks.size(); ++i) {
    if (!landmarks[i].valid()) return static_cast<int32_t>(i);
  }
  return -1;
}

bool Sees(const Map& map, KeyframeId keyframe, LandmarkId landmark) {
  for (const Observation& observation : map.ObservationsOf(landmark)) {
    if (observation.keyframe == keyframe) return true;
  }
  return false;
}

// One mapper's step of random edits of every kind, many of which take back others.
MapDelta RandomStep(Map& map, std::mt19937& generator) {
  MapEditor editor(map);
  const KeyframeId keyframe{map.keyframes().end_id()};
  editor.AddKeyframe(keyframe, {keyframe.value - 1}, {}, Features(keyframe.value));
  for (int i = 0; i < 60; ++i) {
    const LandmarkId any{static_cast<int64_t>(generator()) % (map.landmarks().end_id() + 1)};
    const LandmarkId other{static_cast<int64_t>(generator()) % (map.landmarks().end_id() + 1)};
    const KeyframeId observer{static_cast<int64_t>(generator()) % map.keyframes().end_id()};
    switch (generator() % 8) {
      case 0:
      case 1:
        editor.AddLandmark({.min_distance = static_cast<double>(i)});
        break;
      case 2:
      case 3:
        if (map.landmarks().Has(any) && map.keyframes().Has(observer) && !Sees(map, observer, any) &&
            FreeKeypoint(map, observer) >= 0) {
          editor.AddObservation(any, {observer, FreeKeypoint(map, observer)});
        }
        break;
      case 4:
        if (map.landmarks().Has(any)) editor.ChangeLandmark(any, {.max_distance = static_cast<double>(i)});
        break;
      case 5:
        if (map.landmarks().Has(any) && map.landmarks().Has(other) && any != other) editor.MergeLandmarks(any, other);
        break;
      case 6:
        if (map.landmarks().Has(any) && generator() % 3 == 0) editor.RemoveLandmark(any);
        break;
      default:
        if (map.keyframes().Has(observer)) {
          if (generator() % 6 == 0 && observer != keyframe) {
            editor.RemoveKeyframe(observer);
          } else {
            editor.MoveKeyframe(observer, {Eigen::Quaterniond::Identity(), {1.0 * i, 0, 0}});
            editor.SetParent(observer, keyframe);
          }
        }
    }
  }
  return editor.Finish(keyframe);
}

TEST(MapEditor, ItsDeltaDoesToAReplicaWhatTheEditsDidToTheMap) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 generator(seed);
    Map owner, replica;
    for (int step = 0; step < 25; ++step) {
      const MapDelta delta = RandomStep(owner, generator);
      ASSERT_THAT(replica.Apply(delta), IsSuccess()) << "seed " << seed << " step " << step;
      ASSERT_EQ(replica.next_delta(), owner.next_delta());
    }
    EXPECT_EQ(replica.Sha256Hex(), owner.Sha256Hex());
    replica.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
      EXPECT_EQ(keyframe.covisible, owner.FindKeyframe(id)->covisible);
    });
  }
}

TEST(MapEditor, EditsThatAreTakenBackLeaveNoTrace) {
  Map map;
  MapEditor first(map);
  first.AddKeyframe({0}, {}, {}, Features(0));
  const LandmarkId kept = first.AddLandmark({});
  first.AddObservation(kept, {{0}, 5});
  (void)first.Finish({0});
  const uint64_t before = map.hash();
  MapEditor second(map);
  const LandmarkId brief = second.AddLandmark({});
  second.RemoveObservation(kept, {{0}, 5});
  second.AddObservation(brief, {{0}, 5});
  second.RemoveLandmark(brief);
  second.AddObservation(kept, {{0}, 5});
  const MapDelta delta = second.Finish({0});
  EXPECT_EQ(map.hash(), before);
  EXPECT_TRUE(delta.changed_landmarks.empty());
  EXPECT_TRUE(delta.new_observations.empty());
  EXPECT_TRUE(delta.removed_observations.empty());
  EXPECT_TRUE(delta.removed_landmarks.empty());
}

}  // namespace
}  // namespace tessera
