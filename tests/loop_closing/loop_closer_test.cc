// The loop closer's step on planted maps: it finds a place seen again and where the camera stands there, refuses what
// only looks alike, and answers lost cameras.
#include "loop_closing/loop_closer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <random>
#include <stdexcept>
#include <vector>

#include "mapping/map_correction.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

std::shared_ptr<const Vocabulary> ShippedVocabulary() {
  static const auto vocabulary = Vocabulary::Load(TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
  return vocabulary;
}

constexpr int64_t kVisit = 6;  // keyframes of each visit

Sim3 Away(double scale) { return {scale, ExpSO3({0.1, -0.4, 0.2}), {7.0, 1.0, -3.0}}; }

using Change = std::function<void(FeatureFrame&)>;

// One place visited twice, the second time as another part of the map, which `second_from_truth` takes elsewhere.
void PlantTwoVisits(PlantedMap& planted, const Sim3& second_from_truth, const Change& change = [](FeatureFrame&) {}) {
  for (int64_t k = 0; k < kVisit; ++k) planted.Add(k, {k - 1}, 0);
  for (int64_t k = 0; k < kVisit; ++k) {
    planted.Add(k, k == 0 ? KeyframeId{} : KeyframeId{kVisit + k - 1}, 1, second_from_truth, change);
  }
}

LoopCloser CloserOf(const PlantedMap& planted) {
  LoopCloser closer(ShippedVocabulary(), {});
  for (const MapDelta& delta : planted.deltas()) EXPECT_THAT(closer.ApplyDelta(delta), IsSuccess());
  return closer;
}

void ExpectSame(const LoopResult& a, const LoopResult& b) {
  EXPECT_EQ(a.answers, b.answers);
  EXPECT_EQ(a.matched, b.matched);
  EXPECT_EQ(a.matched_from_current.scale, b.matched_from_current.scale);
  EXPECT_EQ(a.matched_from_current.translation, b.matched_from_current.translation);
  EXPECT_EQ(a.seen, b.seen);
  EXPECT_EQ(a.num_candidates, b.num_candidates);
  EXPECT_EQ(a.num_consistent, b.num_consistent);
  EXPECT_EQ(a.num_matched, b.num_matched);
  EXPECT_EQ(a.num_aligned, b.num_aligned);
  EXPECT_EQ(a.num_contradicted, b.num_contradicted);
  ASSERT_EQ(a.corrections.size(), b.corrections.size());
  for (size_t i = 0; i < a.corrections.size(); ++i) {
    EXPECT_EQ(a.corrections[i].id, b.corrections[i].id);
    EXPECT_EQ(a.corrections[i].new_world_from_old.translation, b.corrections[i].new_world_from_old.translation);
  }
}

TEST(LoopCloser, FindsWhereItIsUpToTheScaleOfTheMap) {
  for (const double scale : {0.5, 0.8, 1.0, 2.0}) {
    SyntheticWorld world(SensorType::kMono, 0.3);
    PlantedMap planted(world);
    PlantTwoVisits(planted, Away(scale));
    const LoopCloser closer = CloserOf(planted);
    const KeyframeId current{2 * kVisit - 1};
    const LoopResult loop = closer.FindLoop(current);
    ASSERT_TRUE(loop.matched.valid()) << scale;
    EXPECT_LT(loop.matched.value, kVisit);
    EXPECT_TRUE(loop.joins_parts);
    EXPECT_NEAR(loop.matched_from_current.scale * scale, 1.0, 0.01);
    const Rigid3 truth = planted.Between(loop.matched, current);
    EXPECT_LT((loop.matched_from_current.translation - truth.translation).norm(), 0.03);
    EXPECT_LT(loop.matched_from_current.rotation.angularDistance(truth.rotation), 0.003);
    EXPECT_GE(loop.num_candidates, loop.num_consistent);
    EXPECT_GE(loop.num_matched, loop.num_aligned);
    EXPECT_GE(loop.num_aligned, 1);
    // What it says it sees is what it sees.
    size_t num_right = 0;
    for (const SeenLandmark& seen : loop.seen) {
      const Observation first = closer.map().ObservationsOf(seen.landmark).front();
      EXPECT_LT(first.keyframe.value, kVisit);
      num_right += planted.PointOf(first) == planted.PointOf({current, seen.keypoint}) ? 1U : 0U;
    }
    EXPECT_EQ(num_right, loop.seen.size());
    EXPECT_GE(loop.seen.size(), 45U);
    // The mapper, which applies these corrections, then has one place.
    MapEditor editor(planted.map());
    CloseLoop(loop, {}, editor);
    (void)editor.Finish(current);
    EXPECT_LT(planted.WorstKeyframe(planted.map()), 0.1) << scale;
  }
}

TEST(LoopCloser, StereoKeepsTheScale) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.0));
  const LoopResult loop = CloserOf(planted).FindLoop({2 * kVisit - 1});
  ASSERT_TRUE(loop.matched.valid());
  EXPECT_EQ(loop.matched_from_current.scale, 1.0);
  const Rigid3 truth = planted.Between(loop.matched, loop.answers);
  EXPECT_LT((loop.matched_from_current.translation - truth.translation).norm(), 0.03);
  for (const auto& correction : loop.corrections) EXPECT_NEAR(correction.new_world_from_old.scale, 1.0, 1e-12);
}

// A third of the corners shows something else this time.
TEST(LoopCloser, OutliersDoNotMislead) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticWorld world(sensor, 0.3);
    PlantedMap planted(world);
    const Sim3 away = Away(sensor == SensorType::kMono ? 1.5 : 1.0);
    PlantTwoVisits(planted, away, [&](FeatureFrame& features) {
      for (size_t i = 0; i + 7 < features.keypoints.size(); i += 3) {
        std::swap(features.descriptors[i], features.descriptors[i + 7 - i % 2]);
      }
    });
    const LoopResult loop = CloserOf(planted).FindLoop({2 * kVisit - 1});
    ASSERT_TRUE(loop.matched.valid()) << ToString(sensor);
    const Rigid3 truth = planted.Between(loop.matched, loop.answers);
    EXPECT_LT((loop.matched_from_current.translation - truth.translation).norm(), 0.05);
    EXPECT_NEAR(loop.matched_from_current.scale * away.scale, 1.0, 0.02);
  }
}

// The same corners, but each stands where another one stood: the bags are equal, the place is not.
TEST(LoopCloser, RefusesAPlaceThatOnlyLooksAlike) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.0), [](FeatureFrame& features) {
    std::mt19937 generator(5);
    std::shuffle(features.descriptors.begin(), features.descriptors.end(), generator);
  });
  const LoopResult loop = CloserOf(planted).FindLoop({2 * kVisit - 1});
  EXPECT_GT(loop.num_candidates, 0);
  EXPECT_GT(loop.num_consistent, 0);
  EXPECT_FALSE(loop.matched.valid());
  EXPECT_EQ(loop.num_aligned, 0);
  EXPECT_TRUE(loop.corrections.empty());
  EXPECT_TRUE(loop.seen.empty());
}

// A car of the same make parked at another place: a quarter of the image is as it was, and the rest is not.
void KeepTheLeft(FeatureFrame& features) {
  std::vector<size_t> others;
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    if (features.keypoints[i].x_px > 240.0F) others.push_back(i);
  }
  std::mt19937 generator(5);
  for (size_t i = others.size(); i > 1; --i) {
    std::swap(features.descriptors[others[i - 1]], features.descriptors[others[generator() % i]]);
  }
}

TEST(LoopCloser, RefusesAThingThatStandsInTwoPlaces) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticWorld world(sensor, 0.3);
    PlantedMap planted(world);
    PlantTwoVisits(planted, Away(1.0), KeepTheLeft);
    const LoopResult loop = CloserOf(planted).FindLoop({2 * kVisit - 1});
    EXPECT_GT(loop.num_aligned, 0) << "what is the same agrees with a pose";
    EXPECT_FALSE(loop.matched.valid());

    LoopCloserOptions credulous;
    credulous.verification.min_coverage = 0.0;
    LoopCloser closer(ShippedVocabulary(), credulous);
    for (const MapDelta& delta : planted.deltas()) ASSERT_THAT(closer.ApplyDelta(delta), IsSuccess());
    EXPECT_TRUE(closer.FindLoop({2 * kVisit - 1}).matched.valid());

    RelocalizationRequest request;
    request.features = *planted.map().FindKeyframe({2 * kVisit - 1})->features;
    LoopCloser of_first(ShippedVocabulary(), {});
    for (int64_t k = 0; k < kVisit; ++k)
      ASSERT_THAT(of_first.ApplyDelta(planted.deltas()[static_cast<size_t>(k)]), IsSuccess());
    EXPECT_FALSE(of_first.Relocalize(request).reference.valid());
  }
}

// Streets alike, with the same cars parked at the same distances: the place fits a pose, but the map knows better.
TEST(LoopCloser, RefusesAPlaceThatContradictsTheMap) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticWorld world(sensor, 0.3);
    PlantedMap planted(world);
    // One part: the map says that the camera went on, and that the second visit was elsewhere.
    for (int64_t k = 0; k < kVisit; ++k) planted.Add(k, {k - 1}, 0);
    for (int64_t k = 0; k < kVisit; ++k) planted.Add(k, {kVisit + k - 1}, 1, Away(1.0));
    const auto find_loop = [&](const LoopCloserOptions& options) {
      LoopCloser closer(ShippedVocabulary(), options);
      for (const MapDelta& delta : planted.deltas()) EXPECT_THAT(closer.ApplyDelta(delta), IsSuccess());
      return closer.FindLoop({2 * kVisit - 1});
    };
    LoopCloserOptions strict;
    (sensor == SensorType::kMono ? strict.max_contradiction_sigmas : strict.max_contradiction_sigmas_with_depth) = 1.0;
    const LoopResult refused = find_loop(strict), allowed = find_loop({});
    EXPECT_GT(refused.num_contradicted, 0);
    EXPECT_FALSE(refused.matched.valid());
    EXPECT_TRUE(refused.corrections.empty());
    EXPECT_TRUE(refused.seen.empty());
    EXPECT_EQ(allowed.num_contradicted, 0) << "nothing ties the two visits, so this map doesn't know";
    EXPECT_TRUE(allowed.matched.valid());
  }
}

// Of two parts, nothing is known that could contradict: the place itself must show enough of what should be there.
TEST(LoopCloser, AnotherPartAndALostCameraNeedMoreOfThePlace) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.0), [](FeatureFrame& features) {  // a part of the corners is new
    for (size_t i = 0; i + 7 < features.keypoints.size(); i += 3) {
      std::swap(features.descriptors[i], features.descriptors[i + 7 - i % 2]);
    }
  });
  RelocalizationRequest request;
  request.features = *planted.map().FindKeyframe({2 * kVisit - 1})->features;
  for (const bool is_strict : {false, true}) {
    LoopCloserOptions options;
    if (is_strict) options.min_share_to_join = options.relocalization.min_seen_share = 1.0;
    LoopCloser closer(ShippedVocabulary(), options), of_first(ShippedVocabulary(), options);
    for (const MapDelta& delta : planted.deltas()) ASSERT_THAT(closer.ApplyDelta(delta), IsSuccess());
    for (int64_t k = 0; k < kVisit; ++k)
      ASSERT_THAT(of_first.ApplyDelta(planted.deltas()[static_cast<size_t>(k)]), IsSuccess());
    EXPECT_EQ(closer.FindLoop({2 * kVisit - 1}).matched.valid(), !is_strict);
    EXPECT_EQ(of_first.Relocalize(request).reference.valid(), !is_strict);
  }
}

TEST(LoopCloser, NoLoopOnTheFirstVisitNorForAKeyframeThatIsGone) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.0));
  const LoopCloser closer = CloserOf(planted);
  for (int64_t k = 0; k < kVisit; ++k) {
    const LoopResult result = closer.FindLoop({k});
    EXPECT_EQ(result.answers, KeyframeId{k});
    EXPECT_FALSE(result.matched.valid()) << k;
    EXPECT_EQ(result.num_candidates, 0) << k;
  }
  EXPECT_FALSE(closer.FindLoop({1000}).matched.valid());
}

TEST(LoopCloser, OneThatStartsLateFromASnapshotAnswersTheSame) {
  SyntheticWorld world(SensorType::kMono, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.3));
  const LoopCloser whole = CloserOf(planted);
  for (const size_t num_before : {size_t{2}, size_t{8}, planted.deltas().size()}) {
    Map map;
    for (size_t i = 0; i < num_before; ++i) ASSERT_THAT(map.Apply(planted.deltas()[i]), IsSuccess());
    LoopCloser late(ShippedVocabulary(), {});
    if (num_before == 8) {
      ASSERT_THAT(late.ApplyDelta(planted.deltas()[0]), IsSuccess());  // it had begun, and went wrong
    }
    ASSERT_THAT(late.ApplyDelta(map.Snapshot()), IsSuccess());
    for (size_t i = num_before; i < planted.deltas().size(); ++i)
      ASSERT_THAT(late.ApplyDelta(planted.deltas()[i]), IsSuccess());
    for (int64_t k = 0; k < 2 * kVisit; ++k) ExpectSame(late.FindLoop({k}), whole.FindLoop({k}));
  }
}

TEST(LoopCloser, CulledKeyframesAreNoPlacesAnyMore) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  PlantTwoVisits(planted, Away(1.0));
  LoopCloser closer = CloserOf(planted);
  const KeyframeId matched = closer.FindLoop({2 * kVisit - 1}).matched;
  ASSERT_TRUE(matched.valid());
  MapEditor editor(planted.map());
  planted.map().keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    if (keyframe.parent == matched) editor.SetParent(id, planted.map().FindKeyframe(matched)->parent);
  });
  editor.RemoveKeyframe(matched);
  ASSERT_THAT(closer.ApplyDelta(editor.Finish({2 * kVisit - 1})), IsSuccess());
  const LoopResult loop = closer.FindLoop({2 * kVisit - 1});
  ASSERT_TRUE(loop.matched.valid()) << "its neighbors show the place as well";
  EXPECT_NE(loop.matched, matched);
  MapEditor rest(planted.map());
  for (int64_t k = 0; k < kVisit; ++k) {
    if (planted.map().FindKeyframe({k}) != nullptr) rest.RemoveKeyframe({k});
  }
  ASSERT_THAT(closer.ApplyDelta(rest.Finish({2 * kVisit - 1})), IsSuccess());
  EXPECT_EQ(closer.FindLoop({2 * kVisit - 1}).num_candidates, 0);
  EXPECT_EQ(closer.Relocalize({*planted.map().FindKeyframe({2 * kVisit - 1})->features, {}}).reference.value / kVisit,
            1);
}

// A lost camera between two keyframes of the first visit.
TEST(Relocalization, FindsACameraInEachUnitOfTheMap) {
  for (const double scale : {1.0, 2.0}) {
    SyntheticWorld world(scale == 1.0 ? SensorType::kStereo : SensorType::kMono, 0.3);
    PlantedMap planted(world);
    for (int64_t k = 0; k < kVisit; ++k) planted.Add(2 * k, {k - 1}, 0, Away(scale));
    if (scale != 1.0) {  // the map was corrected since: older measurements are in other units
      MapEditor editor(planted.map());
      ApplyCorrections({{{0}, Away(0.7)}}, editor);
      (void)editor.Finish({kVisit - 1});
    }
    LoopCloser closer(ShippedVocabulary(), {});
    ASSERT_THAT(closer.ApplyDelta(planted.map().Snapshot()), IsSuccess());
    RelocalizationRequest request;
    request.features = world.Take(5).features;
    request.features.frame = {321};
    const RelocalizationAnswer answer = closer.Relocalize(request);
    EXPECT_EQ(answer.frame, FrameId{321});
    ASSERT_TRUE(answer.reference.valid());
    EXPECT_GT(answer.num_candidates, 0);
    const Keyframe& reference = *closer.map().FindKeyframe(answer.reference);
    const Sim3 map_from_truth = scale == 1.0 ? Away(scale) : Away(0.7) * Away(scale);
    const Eigen::Vector3d center = (reference.WorldFromKeyframe() * answer.reference_from_camera).translation;
    EXPECT_LT((center - map_from_truth * world.Pose(5.0).translation).norm(), 0.05 * map_from_truth.scale);
    // In units of the time when the reference came into the map.
    const Rigid3 truth = planted.Truth(answer.reference).Inverse() * world.Pose(5.0);
    EXPECT_LT((answer.reference_from_camera.translation - scale * truth.translation).norm(), 0.05 * scale);
    EXPECT_GE(answer.seen.size(), 50U);
    for (const SeenLandmark& seen : answer.seen) EXPECT_NE(closer.map().FindLandmark(seen.landmark), nullptr);
  }
}

TEST(Relocalization, HasNoAnswerForAnUnknownPlace) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  for (int64_t k = 0; k < kVisit; ++k) planted.Add(k, {k - 1});
  const LoopCloser closer = CloserOf(planted);
  RelocalizationRequest request;
  request.features = world.Take(3).features;
  EXPECT_TRUE(closer.Relocalize(request).reference.valid());
  std::mt19937 generator(2);
  std::shuffle(request.features.descriptors.begin(), request.features.descriptors.end(), generator);
  EXPECT_FALSE(closer.Relocalize(request).reference.valid()) << "looks alike, and is another place";
  request.features.keypoints.clear();
  request.features.descriptors.clear();
  EXPECT_FALSE(closer.Relocalize(request).reference.valid()) << "a black image";
  const LoopCloser empty(ShippedVocabulary(), {});
  EXPECT_FALSE(empty.Relocalize(request).reference.valid());
}

TEST(LoopCloser, OptionsThatMakeNoSenseAreRefused) {
  LoopCloserOptions options;
  options.verification.min_matches = 2;
  EXPECT_THROW(LoopCloser(ShippedVocabulary(), options), std::invalid_argument);
}

}  // namespace
}  // namespace tessera
