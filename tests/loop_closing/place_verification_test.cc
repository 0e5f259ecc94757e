// Whether a candidate really is the place that a keyframe shows.
#include "loop_closing/place_verification.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>

#include "place_recognition/vocabulary.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// The landmarks of a place, and a frame at the last keyframe's pose.
class PlaceCoverage : public testing::Test {
 protected:
  PlaceCoverage() {
    for (int64_t k = 0; k < 4; ++k) planted_.Add(k, {k - 1});
    points_ = LandmarksAround(planted_.map(), {3}, 10);
    frame_ = std::make_unique<TrackedFrame>(ViewOf(*planted_.map().FindKeyframe({3})->features));
    frame_->world_from_camera = planted_.Truth({3});
    MatchLocal(points_, 6.0, {}, *frame_);
  }
  void ForgetPoints(float from_x_px, float to_x_px) {
    const FeatureFrame& features = frame_->view->features();
    for (size_t i = 0; i < frame_->points.size(); ++i) {
      const float x_px = features.keypoints[i].x_px;
      if (x_px >= from_x_px && x_px < to_x_px) frame_->points[i] = {};
    }
  }

  SyntheticWorld world_{SensorType::kStereo};
  PlantedMap planted_{world_};
  KnownPoints points_;
  std::unique_ptr<TrackedFrame> frame_;
};

TEST_F(PlaceCoverage, IsNearlyFullWhereAllIsSeen) { EXPECT_GT(Coverage(points_, *frame_), 0.95); }

TEST_F(PlaceCoverage, IsTheShareOfTheImageThatIsSeen) {
  ForgetPoints(0.0F, 480.0F);
  const double half = Coverage(points_, *frame_);
  EXPECT_GT(half, 0.3);
  EXPECT_LT(half, 0.7);
  ForgetPoints(480.0F, 960.0F);
  EXPECT_EQ(Coverage(points_, *frame_), 0.0);
}

TEST_F(PlaceCoverage, OneMatchOfACellIsEnough) {
  const double full = Coverage(points_, *frame_);
  for (size_t i = 0; i < frame_->points.size(); i += 2) frame_->points[i] = {};
  EXPECT_GT(Coverage(points_, *frame_), 0.8 * full);
}

TEST_F(PlaceCoverage, WithoutAnythingToSeeItIsNone) {
  EXPECT_EQ(Coverage({}, *frame_), 0.0);
  frame_->world_from_camera =
      planted_.Truth({3}) * Rigid3{ExpSO3({0.0, 3.1, 0.0}), Eigen::Vector3d::Zero()};  // looks back
  EXPECT_EQ(Coverage(points_, *frame_), 0.0);
}

TEST_F(PlaceCoverage, LocalizingStartsNearTheTruthAndEndsThere) {
  Eigen::Matrix<double, 6, 1> error;
  error << 0.02, 0.01, -0.02, 0.002, 0.002, -0.001;
  frame_->world_from_camera = Retract(planted_.Truth({3}), error);
  const int num_left = LocalizeAmong(points_, {.local_radius_px = 6.0, .max_hamming = 64}, {}, *frame_);
  EXPECT_GT(num_left, 200);
  EXPECT_THAT(frame_->world_from_camera, IsNear(planted_.Truth({3}), 2e-3));
}

TEST(LandmarksAround, AreThoseOfTheKeyframeAndItsNeighborsOnceEach) {
  SyntheticWorld world(SensorType::kStereo);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k - 1});
  const KnownPoints own = LandmarksAround(planted.map(), {0}, 0), all = LandmarksAround(planted.map(), {0}, 3);
  EXPECT_EQ(own.size(), planted.map().FindKeyframe({0})->landmarks.size());
  EXPECT_EQ(all.size(), static_cast<size_t>(planted.map().landmarks().size()));
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(),
                             [](const auto& a, const auto& b) { return a.first.landmark < b.first.landmark; }));
}

// Two visits of one place as two parts of the map, and the bags of all keyframes.
class PlaceVerification : public testing::Test {
 protected:
  void Plant(const std::function<void(FeatureFrame&)>& change = [](FeatureFrame&) {}) {
    for (int64_t k = 0; k < 4; ++k) planted_.Add(k, {k - 1}, 0);
    for (int64_t k = 4; k < 8; ++k) planted_.Add(k - 4, k == 4 ? KeyframeId{} : KeyframeId{k - 1}, 1, kAway, change);
    static const auto vocabulary = Vocabulary::Load(TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
    planted_.map().keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
      places_.Add(id, std::make_shared<const BagOfWords>(vocabulary->Describe(keyframe.features->descriptors)));
    });
  }
  std::optional<VerifiedPlace> Verify(const VerificationOptions& options = {}) {
    steps_ = {};
    return VerifyPlace(planted_.map(), places_, {7}, {3}, options, &steps_);
  }

  inline static const Sim3 kAway{1.0, ExpSO3({0.1, -0.4, 0.2}), {7.0, 1.0, -3.0}};
  SyntheticWorld world_{SensorType::kStereo, 0.3};
  PlantedMap planted_{world_};
  PlaceDatabase places_;
  VerificationSteps steps_;
};

TEST_F(PlaceVerification, MeasuresTheRelativePoseAndTellsWhatIsSeen) {
  Plant();
  const std::optional<VerifiedPlace> place = Verify();
  ASSERT_TRUE(place.has_value());
  EXPECT_TRUE(steps_.is_matched && steps_.is_aligned);
  EXPECT_EQ(place->matched, KeyframeId{3});
  EXPECT_THAT(place->matched_from_current, IsNear(Sim3::From(planted_.Between({3}, {7})), 0.03));
  EXPECT_GE(place->seen.size(), 45U);
}

TEST_F(PlaceVerification, AsksForEnoughMatchesAlignedLandmarksAndCoverage) {
  Plant();
  EXPECT_FALSE(Verify({.min_matches = 100000}));
  EXPECT_FALSE(steps_.is_matched);
  EXPECT_FALSE(Verify({.min_seen = 100000}));
  EXPECT_TRUE(steps_.is_aligned) << "the last step refused it";
  EXPECT_TRUE(Verify({.min_coverage = 0.0}));
}

TEST_F(PlaceVerification, KeyframesWithoutABagDoNotMatch) {
  Plant();
  places_.Remove({3});
  EXPECT_FALSE(Verify());
  EXPECT_FALSE(steps_.is_matched);
}

TEST_F(PlaceVerification, TheSameCornersInAnotherOrderDoNotAlign) {
  Plant([](FeatureFrame& features) {
    std::mt19937 generator(5);
    std::shuffle(features.descriptors.begin(), features.descriptors.end(), generator);
  });
  EXPECT_FALSE(Verify());
  EXPECT_FALSE(steps_.is_aligned);
}

TEST(VerificationOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(VerificationOptions{}.Check(), IsSuccess());
  EXPECT_THAT(VerificationOptions{.min_matches = 2}.Check(), IsFailure(HasSubstr("3 matches")));
  EXPECT_THAT(VerificationOptions{.min_coverage = 1.5}.Check(), IsFailure(HasSubstr("min_coverage")));
}

}  // namespace
}  // namespace tessera
