// Keyframes that the tracker has sent follow the corrections of the map around them.
#include "tracking/map_replica.h"

#include <gtest/gtest.h>

#include <vector>

#include "map/map_editor.h"
#include "map/spanning_tree.h"
#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

const Sim3 kCorrection{1.8, ExpSO3({0.2, -0.5, 0.1}), {3.0, 0.0, -2.0}};
const Rigid3 kStep{ExpSO3({0.0, 0.1, 0.0}), {0.1, 0.0, 1.0}};

// The owner's map of keyframes 0 and 1, of which 1 has been enlarged before.
class Owner {
 public:
  Owner() {
    deltas_.push_back(Edit([](MapEditor& editor) {
      editor.AddKeyframe({0}, {}, {}, PlainFeatures(0, 3));
      editor.AddKeyframe({1}, {0}, Sim3::From(kStep, 1.25), PlainFeatures(1, 3));
    }));
  }
  template <class EditMap>
  MapDelta Edit(EditMap edit, KeyframeId answers = {1}) {
    MapEditor editor(map_);
    edit(editor);
    return editor.Finish(answers);
  }
  MapDelta Correct() {
    return Edit([&](MapEditor& editor) {
      map_.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
        editor.MoveKeyframe(id, kCorrection * keyframe.WorldFromKeyframe());
      });
    });
  }
  const MapDelta& first() const { return deltas_.front(); }
  const Map& map() const { return map_; }

 private:
  Map map_;
  std::vector<MapDelta> deltas_;
};

Landmark PointAt(const Eigen::Vector3d& position) {
  return {.position_in_world = position, .normal = {0, 0, -1}, .min_distance = 2.0, .max_distance = 8.0};
}

void ExpectNear(const Sim3& a, const Sim3& b) {
  EXPECT_NEAR(a.scale, b.scale, 1e-12 * b.scale);
  EXPECT_LT((a.translation - b.translation).norm(), 1e-9);
  EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-7);
}

TEST(MapReplica, AnUnansweredKeyframeHasTheUnitsOfItsReference) {
  Owner owner;
  MapReplica replica;
  ASSERT_THAT(replica.Apply(owner.first()), IsSuccess());
  replica.Send({2}, {{1}, kStep, {{0, PointAt({0.5, 0.0, 4.0})}}});
  replica.Send({3}, {{2}, kStep, {}});
  const Sim3 second = Sim3::From(kStep, 1.25) * kStep;
  ExpectNear(replica.WorldFromKeyframe({2}).value(), second);
  ExpectNear(replica.WorldFromKeyframe({3}).value(), second * kStep);
  const Landmark point = replica.Find({{}, {2}, 0}).value();
  EXPECT_LT((point.position_in_world - second * Eigen::Vector3d(0.5, 0.0, 4.0)).norm(), 1e-12);
  EXPECT_NEAR(point.max_distance, 1.25 * 8.0, 1e-12);
  EXPECT_FALSE(replica.WorldFromKeyframe({4}).has_value());
  EXPECT_FALSE(replica.Find({{}, {2}, 1}).has_value());
}

TEST(MapReplica, ACorrectionMovesUnansweredKeyframesToo) {
  Owner owner;
  MapReplica replica;
  ASSERT_THAT(replica.Apply(owner.first()), IsSuccess());
  replica.Send({2}, {{1}, kStep, {{0, PointAt({0.5, 0.0, 4.0})}}});
  const Sim3 world_from_sent = replica.WorldFromKeyframe({2}).value();
  const Landmark before = replica.Find({{}, {2}, 0}).value();
  ASSERT_THAT(replica.Apply(owner.Correct()), IsSuccess());
  ExpectNear(replica.WorldFromKeyframe({2}).value(), kCorrection * world_from_sent);
  const Landmark after = replica.Find({{}, {2}, 0}).value();
  EXPECT_LT((after.position_in_world - kCorrection * before.position_in_world).norm(), 1e-9);
  EXPECT_LT((after.normal - kCorrection.rotation * before.normal).norm(), 1e-12);
  EXPECT_NEAR(after.min_distance, kCorrection.scale * before.min_distance, 1e-12);
  ASSERT_EQ(replica.SentPoints().size(), 1U);
}

// The reference is culled in one delta, and the map is corrected in the next.
TEST(MapReplica, ACulledReferenceLeavesItsPose) {
  Owner owner;
  MapReplica replica;
  ASSERT_THAT(replica.Apply(owner.first()), IsSuccess());
  replica.Send({2}, {{1}, kStep, {}});
  const Sim3 before = replica.WorldFromKeyframe({2}).value();
  ASSERT_THAT(replica.Apply(owner.Edit([](MapEditor& editor) { editor.RemoveKeyframe({1}); })), IsSuccess());
  EXPECT_EQ(replica.map().FindKeyframe({1}), nullptr);
  ExpectNear(replica.WorldFromKeyframe({2}).value(), before);
  ASSERT_THAT(replica.Apply(owner.Correct()), IsSuccess());
  ExpectNear(replica.WorldFromKeyframe({1}).value(), kCorrection * Sim3::From(kStep, 1.25));
  ExpectNear(replica.WorldFromKeyframe({2}).value(), kCorrection * before);
}

// As a controller must know it: the part of a pose is named by the keyframe that it began with, until it is joined to
// an older one.
TEST(MapReplica, PartsAreNamedByTheirRoots) {
  Owner owner;
  MapReplica replica;
  ASSERT_THAT(replica.Apply(owner.first()), IsSuccess());
  replica.Send({2}, {{}, kStep, {}});
  replica.Send({3}, {{2}, kStep, {}});
  EXPECT_EQ(replica.PartOf({1}), KeyframeId{0});
  EXPECT_EQ(replica.PartOf({3}), KeyframeId{2});
  EXPECT_FALSE(replica.PartOf({4}).valid());

  ASSERT_THAT(replica.Apply(owner.Edit(
                  [](MapEditor& editor) { editor.AddKeyframe({2}, {}, Sim3::From(kStep), PlainFeatures(2, 3)); }, {2})),
              IsSuccess());
  EXPECT_EQ(replica.PartOf({3}), KeyframeId{2});
  ASSERT_THAT(replica.Apply(owner.Edit([](MapEditor& editor) { AttachTree({2}, {1}, editor); }, {2})), IsSuccess());
  EXPECT_EQ(replica.PartOf({3}), KeyframeId{0});
  ASSERT_THAT(replica.Apply(owner.Edit([](MapEditor& editor) { editor.RemoveKeyframe({1}); }, {2})), IsSuccess());
  EXPECT_EQ(replica.PartOf({1}), KeyframeId{0});
}

// The mapper gives the keyframe the pose that the replica took for it.
TEST(MapReplica, TheAnswerTakesOver) {
  Owner owner;
  MapReplica replica;
  ASSERT_THAT(replica.Apply(owner.first()), IsSuccess());
  replica.Send({2}, {{1}, kStep, {{0, PointAt({0.5, 0.0, 4.0})}}});
  ASSERT_THAT(replica.Apply(owner.Correct()), IsSuccess());
  const Sim3 before = replica.WorldFromKeyframe({2}).value();
  const Landmark point = replica.Find({{}, {2}, 0}).value();
  LandmarkId name;
  const MapDelta answer = owner.Edit(
      [&](MapEditor& editor) {
        editor.AddKeyframe({2}, {1}, owner.map().FindKeyframe({1})->WorldFromKeyframe() * kStep, PlainFeatures(2, 3));
        name = editor.AddLandmark(point);
        editor.AddObservation(name, {{2}, 0});
      },
      {2});
  ASSERT_THAT(replica.Apply(answer), IsSuccess());
  EXPECT_TRUE(replica.sent().empty());
  ExpectNear(replica.WorldFromKeyframe({2}).value(), before);
  EXPECT_EQ(replica.Renew({{}, {2}, 0}).landmark, name);
  EXPECT_FALSE(replica.Renew({{}, {2}, 1}).valid());
  EXPECT_TRUE(replica.SentPoints().empty());
}

}  // namespace
}  // namespace tessera
