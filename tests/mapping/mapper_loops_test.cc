// The mapper's step when loops and global adjustments are due.
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>

#include "map/spanning_tree.h"
#include "mapping/mapper.h"
#include "optimization/global_adjustment.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

const Sim3 kAway{1.0, ExpSO3({0.0, 0.6, 0.0}), {30.0, 1.0, -3.0}};

// A mapper whose map holds a place twice: keyframes 0 .. 5, and 6 .. 11 in another part, far from it. The next ones
// continue in the second part.
class LoopMapper : public testing::Test {
 protected:
  explicit LoopMapper(const MapperOptions& options = {}) : mapper_(options) {
    for (int64_t k = 0; k < 6; ++k) planted_.Add(k, {k - 1}, 0);
    for (int64_t k = 6; k < 12; ++k) planted_.Add(k - 6, k == 6 ? KeyframeId{} : KeyframeId{k - 1}, 1, kAway);
    EXPECT_THAT(mapper_.Load(planted_.map().Snapshot()), IsSuccess());
    EXPECT_THAT(replica_.Apply(planted_.map().Snapshot()), IsSuccess());
  }

  // The next keyframe, as a tracker in the second part tells it: relative to the one before, and seeing its landmarks.
  const MapDelta& Step(const DueCorrections& due = {}) {
    const KeyframeId last{next_ - 1};
    // A planted keyframe has the features and the truth; the mapper's own map goes its own way.
    const KeyframeId id = planted_.Add(next_ - 6, last, 1, kAway);
    KeyframeObservation seen;
    seen.id = id;
    seen.features = *planted_.map().FindKeyframe(id)->features;
    seen.reference = last;
    seen.reference_from_camera = planted_.Between(last, id);
    seen.world_from_camera = planted_.map().FindKeyframe(id)->world_from_camera;
    std::map<size_t, LandmarkId> known;  // by point
    if (const Keyframe* reference = mapper_.map().FindKeyframe(last)) {
      for (size_t i = 0; i < reference->landmarks.size(); ++i) {
        known[planted_.PointOf({last, static_cast<int32_t>(i)})] = reference->landmarks[i];
      }
    }
    for (size_t i = 0; i < seen.features.keypoints.size(); ++i) {
      const auto landmark = known.find(planted_.PointOf({id, static_cast<int32_t>(i)}));
      seen.landmarks.push_back(landmark == known.end() ? LandmarkId{} : landmark->second);
    }
    ++next_;
    delta_ = mapper_.Process(seen, due);
    EXPECT_THAT(replica_.Apply(delta_), IsSuccess());
    EXPECT_EQ(replica_.Sha256Hex(), mapper_.map().Sha256Hex());
    return delta_;
  }

  // What the loop closer would say of `current` in the map as it is now.
  LoopResult LoopAt(KeyframeId current, KeyframeId matched) const {
    const Map& map = mapper_.map();
    LoopResult loop;
    loop.answers = current;
    loop.matched = matched;
    loop.matched_from_current = Sim3::From(planted_.Between(matched, current));
    loop.joins_parts = true;
    const Sim3 new_from_old =
        Sim3::From(map.FindKeyframe(matched)->world_from_camera * planted_.Between(matched, current) *
                   map.FindKeyframe(current)->world_from_camera.Inverse());
    map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) {
      if (RootOf(map, id) == RootOf(map, current)) loop.corrections.push_back({id, new_from_old});
    });
    return loop;
  }
  // All keyframes stand on the truth of the first part.
  double WorstKeyframe() const { return planted_.WorstKeyframe(mapper_.map()); }

  SyntheticWorld world_{SensorType::kStereo, 0.3};
  PlantedMap planted_{world_};
  Mapper mapper_;
  Map replica_;
  int64_t next_ = 12;
  MapDelta delta_;
};

TEST_F(LoopMapper, ADueLoopCorrectsTheMapBeforeTheKeyframeIsInserted) {
  Step();
  const LoopResult loop = LoopAt({11}, {5});
  EXPECT_FALSE(Step().asks_adjustment);
  EXPECT_GT(WorstKeyframe(), 20.0);
  const int64_t num_before = mapper_.map().landmarks().size();
  const MapDelta& delta = Step({{loop}, {}});
  EXPECT_TRUE(delta.asks_adjustment);
  ASSERT_EQ(delta.closed_loops.size(), 1U);
  EXPECT_EQ(delta.closed_loops[0].current, KeyframeId{11});
  EXPECT_LT(WorstKeyframe(), 0.05) << "keyframes that came after the loop was found move along";
  EXPECT_LT(mapper_.map().landmarks().size(), num_before * 8 / 10);
  EXPECT_LE(planted_.NumMixed(mapper_.map()), mapper_.map().landmarks().size() / 50);
  mapper_.map().keyframes().ForEach(
      [&](KeyframeId id, const Keyframe&) { EXPECT_EQ(RootOf(mapper_.map(), id), KeyframeId{0}) << id.value; });
  EXPECT_EQ(mapper_.num_void_loops(), 0);
  EXPECT_FALSE(Step().asks_adjustment) << "one is on its way";
}

// It was measured against poses that are gone.
TEST_F(LoopMapper, ALoopFoundBeforeTheLastCorrectionIsIgnored) {
  Step();
  const LoopResult first = LoopAt({11}, {5});
  Step();
  const LoopResult second = LoopAt({12}, {5});
  Step({{first}, {}});
  Step({{second}, {}});
  EXPECT_EQ(mapper_.num_void_loops(), 1);
  EXPECT_TRUE(delta_.closed_loops.empty());
  EXPECT_LT(WorstKeyframe(), 0.05);
  LoopResult nowhere = first;
  nowhere.matched = {5};
  nowhere.answers = {777};  // was culled
  Step({{nowhere}, {}});
  EXPECT_EQ(mapper_.num_void_loops(), 2);
}

TEST_F(LoopMapper, AnAdjustmentIsAppliedAndThenAnotherMayBeRequested) {
  Step();
  Step({{LoopAt({12}, {5})}, {}});
  ASSERT_TRUE(delta_.asks_adjustment);
  const GlobalAdjustment adjustment = AdjustGlobally(replica_, delta_.answers, GlobalBundleOptions());
  ASSERT_TRUE(adjustment.is_usable);
  Step();
  Step({{}, adjustment});
  EXPECT_FALSE(delta_.asks_adjustment) << "no loop was closed since";
  EXPECT_GT(delta_.moved_keyframes.size(), 5U);
  EXPECT_LT(WorstKeyframe(), 0.05);
}

TEST_F(LoopMapper, AnAdjustmentOutdatedByAnotherLoopIsIgnoredAndRequestedAgain) {
  Step();
  Step({{LoopAt({12}, {5})}, {}});
  ASSERT_TRUE(delta_.asks_adjustment);
  GlobalAdjustment nonsense;  // would be seen in the map
  nonsense.answers = delta_.answers;
  nonsense.is_usable = true;
  replica_.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    nonsense.poses.push_back({id, Rigid3{Eigen::Quaterniond::Identity(), {0, 50, 0}} * keyframe.world_from_camera});
  });
  Step();
  const LoopResult second = LoopAt({14}, {5});
  Step({{second}, {}});
  EXPECT_FALSE(delta_.asks_adjustment) << "the first one is still on its way";
  EXPECT_EQ(mapper_.map().closed_loops().size(), 2U);
  Step({{}, nonsense});
  EXPECT_LT(WorstKeyframe(), 0.05);
  EXPECT_TRUE(delta_.asks_adjustment);
}

TEST_F(LoopMapper, AnUnusableAdjustmentChangesNothing) {
  Step();
  Step({{LoopAt({12}, {5})}, {}});
  GlobalAdjustment useless;
  useless.answers = delta_.answers;
  const std::optional<MapDelta> culled = mapper_.Finish({});
  ASSERT_TRUE(culled.has_value()) << "one of the newest keyframes is redundant";
  EXPECT_FALSE(culled->removed_keyframes.empty());
  EXPECT_TRUE(culled->moved_keyframes.empty());
  const std::optional<MapDelta> delta = mapper_.Finish({{}, useless});
  EXPECT_FALSE(delta.has_value());
}

TEST_F(LoopMapper, AtTheEndTheMapIsCorrectedOnceMore) {
  Step();
  EXPECT_FALSE(mapper_.Finish({}).has_value());
  const LoopResult loop = LoopAt({12}, {5});
  const std::optional<MapDelta> corrected = mapper_.Finish({{loop}, {}});
  ASSERT_TRUE(corrected.has_value());
  EXPECT_TRUE(corrected->asks_adjustment);
  EXPECT_EQ(corrected->answers, KeyframeId{12});
  EXPECT_TRUE(corrected->new_keyframes.empty());
  EXPECT_THAT(replica_.Apply(*corrected), IsSuccess());
  const GlobalAdjustment adjustment = AdjustGlobally(replica_, corrected->answers, GlobalBundleOptions());
  const std::optional<MapDelta> adjusted = mapper_.Finish({{}, adjustment});
  ASSERT_TRUE(adjusted.has_value());
  EXPECT_FALSE(adjusted->asks_adjustment);
  EXPECT_THAT(replica_.Apply(*adjusted), IsSuccess());
  EXPECT_EQ(replica_.Sha256Hex(), mapper_.map().Sha256Hex());
  EXPECT_LT(WorstKeyframe(), 0.05);
}

class PolishingMapper : public LoopMapper {
 protected:
  PolishingMapper() : LoopMapper({.polishes = true}) {}
};

TEST_F(PolishingMapper, AtTheEndEveryPartIsAdjustedOnceThoughNoLoopWasClosed) {
  EXPECT_FALSE(Step().asks_adjustment);
  const std::optional<MapDelta> asking = mapper_.Finish({});
  ASSERT_TRUE(asking.has_value());
  EXPECT_TRUE(asking->asks_adjustment);
  EXPECT_TRUE(asking->new_keyframes.empty());
  EXPECT_THAT(replica_.Apply(*asking), IsSuccess());
  const GlobalAdjustment adjustment = AdjustEveryPart(replica_, GlobalBundleOptions());
  const std::optional<MapDelta> polished = mapper_.Finish({{}, adjustment});
  ASSERT_TRUE(polished.has_value());
  EXPECT_FALSE(polished->asks_adjustment);
  std::set<KeyframeId> parts;
  for (const auto& moved : polished->moved_keyframes) parts.insert(RootOf(replica_, moved.id));
  EXPECT_EQ(parts, (std::set<KeyframeId>{{0}, {6}}));
  EXPECT_THAT(replica_.Apply(*polished), IsSuccess());
  for (const GlobalAdjustment::Pose& pose : adjustment.poses) {
    EXPECT_THAT(mapper_.map().FindKeyframe(pose.id)->world_from_camera, IsNear(pose.world_from_camera, 1e-9));
  }
  EXPECT_FALSE(mapper_.Finish({}).has_value()) << "then the map is final";
}

TEST_F(PolishingMapper, AfterLoopsOfTheEndItIsAskedForOnce) {
  Step();
  const std::optional<MapDelta> corrected = mapper_.Finish({{LoopAt({12}, {5})}, {}});
  ASSERT_TRUE(corrected.has_value());
  EXPECT_TRUE(corrected->asks_adjustment);
  GlobalAdjustment useless;
  useless.answers = corrected->answers;
  EXPECT_FALSE(mapper_.Finish({{}, useless}).has_value());
}

}  // namespace
}  // namespace tessera
