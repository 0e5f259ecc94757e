// Keyframes of frames at true poses in the synthetic world.
#include "tracking/keyframe_making.h"

#include <gtest/gtest.h>

#include <optional>
#include <utility>

#include "support/matchers.h"
#include "support/synthetic_world.h"
#include "tracking/localized_frame.h"

namespace tessera {
namespace {

class KeyframeMaking : public testing::TestWithParam<SensorType> {
 protected:
  LocalizedFrame At(int64_t step) {
    LocalizedFrame localized{world_.TrackedAt(step), {}};
    localized.reference_from_camera = localized.frame.world_from_camera;
    return localized;
  }
  KeyframeObservation Observe(const LocalizedFrame& localized) const {
    return ObserveKeyframe(KeyframeId{4}, localized, world_.calibration(), {.id = KeyframeId{3}}, replica_);
  }

  SyntheticWorld world_{GetParam(), 0.3};
  MapReplica replica_;
};

INSTANTIATE_TEST_SUITE_P(Sensors, KeyframeMaking, testing::Values(SensorType::kMono, SensorType::kStereo));

TEST_P(KeyframeMaking, TheMapperGetsWhatTheFrameSeesByTheCameraOfTheSource) {
  LocalizedFrame localized = At(1);
  FeatureFrame features = localized.frame.view->features();
  features.calibration.fx_px *= 1.01;  // as the mapper has found it
  features.calibration.radial = 0.02;
  features.calibration.right_shift = {.center_px = 0.5};
  localized.frame.view = ViewOf(features);
  const KeyframeObservation keyframe = Observe(localized);
  EXPECT_EQ(keyframe.id, KeyframeId{4});
  EXPECT_EQ(keyframe.reference, KeyframeId{3});
  EXPECT_EQ(keyframe.features.calibration.fx_px, world_.calibration().fx_px);
  EXPECT_EQ(keyframe.features.calibration.radial, 0.02) << "keypoints stay where the lens moved them";
  EXPECT_EQ(keyframe.features.calibration.right_shift.center_px, 0.5) << "right columns, too";
  ASSERT_EQ(keyframe.landmarks.size(), localized.frame.points.size());
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    EXPECT_EQ(keyframe.landmarks[i], localized.frame.points[i].id.landmark);
  }
  EXPECT_TRUE(keyframe.shared.empty());
}

// Points that the mapper has not named yet go by the keyframe that saw them first, and where that one has them.
TEST_P(KeyframeMaking, PointsOfAnUnansweredKeyframeAreShared) {
  const Rigid3 world_from_sent = SyntheticWorld::Pose(0.0);
  replica_.Send(KeyframeId{2}, {{}, world_from_sent, {}});
  LocalizedFrame localized = At(1);
  const Eigen::Vector3d in_world = localized.frame.points[5].landmark.position_in_world;
  localized.frame.points[5].id = {{}, KeyframeId{2}, 77};
  const KeyframeObservation keyframe = Observe(localized);
  ASSERT_EQ(keyframe.shared.size(), 1U);
  EXPECT_EQ(keyframe.shared[0].keypoint, 5);
  EXPECT_EQ(keyframe.shared[0].other, KeyframeId{2});
  EXPECT_EQ(keyframe.shared[0].other_keypoint, 77);
  EXPECT_LT((world_from_sent * keyframe.shared[0].position_in_other - in_world).norm(), 1e-9);
}

TEST_P(KeyframeMaking, KeypointsWithDepthArePointsUntilTheMapperAnswers) {
  LocalizedFrame localized = At(1);
  TrackedFrame& frame = localized.frame;
  const size_t num_known = 50;
  std::vector<SeenPoint> truth = frame.points;
  for (size_t i = num_known; i < frame.points.size(); ++i) frame.points[i] = {};
  SentKeyframe sent{KeyframeId{3}, localized.reference_from_camera, {}};
  AddDepthPoints(KeyframeId{4}, {}, frame, sent);
  EXPECT_EQ(sent.points.empty(), GetParam() == SensorType::kMono);
  EXPECT_EQ(frame.NumPoints(), static_cast<int>(num_known + sent.points.size()));
  for (const auto& [keypoint, in_camera] : sent.points) {
    ASSERT_GE(keypoint, static_cast<int32_t>(num_known));
    const SeenPoint& seen = frame.points[Index(keypoint)];
    EXPECT_EQ(seen.id, (PointId{{}, KeyframeId{4}, keypoint}));
    EXPECT_GT(in_camera.depth_sigma, 0.0);
    EXPECT_LT((seen.landmark.position_in_world - frame.world_from_camera * in_camera.position_in_world).norm(), 1e-9);
    const Eigen::Vector3d error = seen.landmark.position_in_world - truth[Index(keypoint)].landmark.position_in_world;
    EXPECT_LT(error.norm(), 5.0 * in_camera.depth_sigma + 0.05);
  }
}

// A keyframe at step 2 of which `num_known` points are left, and its reference at step 0, which knows none.
class Pair : public KeyframeMaking {
 protected:
  // `way_sigma_share`: what the motion so far doesn't know of the way, by its length; 0: images fix the way.
  void Make(size_t num_known, bool is_wide_step, double way_sigma_share) {
    LocalizedFrame other = At(0);
    for (SeenPoint& point : other.frame.points) point = {};
    localized_.emplace(At(2));
    localized_->is_wide_step = is_wide_step;
    for (size_t i = num_known; i < localized_->frame.points.size(); ++i) localized_->frame.points[i] = {};
    const ReferenceKeyframe reference{.id = KeyframeId{3}, .frame = other.frame};
    replica_.Send(reference.id, {{}, other.frame.world_from_camera, {}});
    keyframe_ = Observe(*localized_);
    keyframe_.expected = {};
    if (way_sigma_share > 0.0) {
      const double sigma = way_sigma_share * keyframe_.reference_from_camera.translation.norm();
      keyframe_.expected.information = Eigen::Matrix3d::Identity() / (sigma * sigma);
    }
    AddPairPoints(reference, replica_, *localized_, keyframe_, sent_);
  }

  std::optional<LocalizedFrame> localized_;
  KeyframeObservation keyframe_;
  SentKeyframe sent_{KeyframeId{3}, {}, {}};
};

INSTANTIATE_TEST_SUITE_P(Sensors, Pair, testing::Values(SensorType::kMono, SensorType::kStereo));

TEST_P(Pair, AWideOneOfMonoHasPointsOfItsOwn) {
  Make(0, true, 0.0);
  const bool is_mono = GetParam() == SensorType::kMono;
  EXPECT_EQ(sent_.points.size() > 100, is_mono);
  EXPECT_EQ(keyframe_.shared.size(), sent_.points.size()) << "no known point is left in view: the mapper gets them too";
  EXPECT_EQ(localized_->frame.NumPoints(), static_cast<int>(sent_.points.size()));
}

TEST_P(Pair, WherePointsFadeTheMapperGetsThemOnceAThirdViewHasSeenThem) {
  Make(30, false, 0.1);
  EXPECT_EQ(sent_.points.size() > 100, GetParam() == SensorType::kMono);
  EXPECT_EQ(localized_->frame.NumPoints(), static_cast<int>(30 + sent_.points.size()));
  EXPECT_TRUE(keyframe_.shared.empty());
}

TEST_P(Pair, ANarrowOneHasNoneOtherwise) {
  for (const auto& [num_known, way_sigma_share] : {std::pair<size_t, double>{100, 0.1}, {30, 0.0}, {30, 0.3}}) {
    Make(num_known, false, way_sigma_share);
    EXPECT_TRUE(sent_.points.empty()) << num_known << " known points, the way is open by " << way_sigma_share;
  }
}

}  // namespace
}  // namespace tessera
