#include "matching/matching.h"

#include <gmock/gmock.h>

#include <vector>

#include "support/synthetic_world.h"

namespace tessera {
namespace {

using testing::ElementsAre;

// Matches of two pictures around where the first keypoints would be seen, and how many of them are right.
struct Matched {
  size_t num = 0;
  size_t num_right = 0;
};

Matched MatchPictures(const SyntheticWorld::Picture& first, const SyntheticWorld::Picture& second, double radius_px) {
  const FrameView first_view(first.features), second_view(second.features);
  std::vector<Eigen::Vector2d> centers_px;
  for (int i = 0; i < first_view.size(); ++i) centers_px.push_back(first_view.pixel(i));
  const auto matches = MatchInWindow(first_view, centers_px, second_view, radius_px, {.check_rotation = false});
  Matched matched{.num = matches.size()};
  for (const Match& match : matches) {
    matched.num_right += first.points[Index(match.first)] == second.points[Index(match.second)] ? 1 : 0;
  }
  return matched;
}

TEST(MatchInWindow, FindsTheSamePointsInTheNextFrame) {
  SyntheticWorld world(SensorType::kMono, 0.3);
  const SyntheticWorld::Picture first = world.Take(0), second = world.Take(1);
  const Matched matched = MatchPictures(first, second, 60.0);
  EXPECT_GT(matched.num, 300U);
  EXPECT_EQ(matched.num_right, matched.num);
}

TEST(MatchInWindow, FindsNothingOutsideTheWindow) {
  SyntheticWorld world(SensorType::kMono);
  SyntheticWorld::Picture first = world.Take(0), moved = first;
  for (Keypoint& keypoint : moved.features.keypoints) keypoint.x_px += 12.0F;
  EXPECT_EQ(MatchPictures(first, moved, 13.0).num_right, first.points.size());
  EXPECT_EQ(MatchPictures(first, moved, 11.0).num_right, 0U);
}

TEST(MatchInWindow, LooksOneLevelUpAndDownOnly) {
  SyntheticWorld world(SensorType::kMono);
  const SyntheticWorld::Picture first = world.Take(0);
  for (const int shift : {0, 1, 2}) {
    SyntheticWorld::Picture second = first;
    for (Keypoint& keypoint : second.features.keypoints) keypoint.level = static_cast<uint8_t>(keypoint.level + shift);
    EXPECT_EQ(MatchPictures(first, second, 1.0).num_right > 0, shift < 2) << shift;
  }
}

TEST(BestMatch, IsClearIfNearAndMuchNearerThanTheSecond) {
  const MatchingOptions options{.max_hamming = 50, .max_ratio = 0.8};
  BestMatch best;
  EXPECT_FALSE(best.IsClear(options)) << "nothing was offered";
  best.Offer(4, 40);
  EXPECT_TRUE(best.IsClear(options));
  best.Offer(7, 50);
  EXPECT_TRUE(best.IsClear(options)) << "40 is 0.8 of 50";
  best.Offer(8, 49);
  EXPECT_FALSE(best.IsClear(options));
  EXPECT_EQ(best.index, 4);

  BestMatch far;
  far.Offer(1, 51);
  EXPECT_FALSE(far.IsClear(options));
}

TEST(BestMatch, OfEqualsTheLowerIndexWins) {
  BestMatch best;
  best.Offer(9, 30);
  best.Offer(3, 30);
  EXPECT_EQ(best.index, 3);
  EXPECT_EQ(best.second_distance, 30);
}

TEST(KeepBestPerSecond, GivesEachSecondToTheNearestThenToTheFirst) {
  const std::vector<Match> kept = KeepBestPerSecond({{0, 5, 20}, {1, 5, 10}, {2, 6, 30}, {3, 6, 30}}, 8);
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_EQ(kept[0].first, 1);
  EXPECT_EQ(kept[1].first, 2);
}

TEST(RotationHistogramInliers, AreInTheThreeFullestNeighboringBins) {
  // Bins are 8 wide; the peak lies on a border.
  EXPECT_THAT(RotationHistogramInliers(std::vector<uint8_t>{40, 39, 41, 33, 60, 100, 200}),
              ElementsAre(1, 1, 1, 1, 0, 0, 0));
}

TEST(RotationHistogramInliers, TheCircleIsClosed) {
  EXPECT_THAT(RotationHistogramInliers(std::vector<uint8_t>{2, 254, 1, 250, 128}), ElementsAre(1, 1, 1, 1, 0));
}

TEST(KeepRotationInliers, DropsMatchesThatRotateUnlikeTheOthers) {
  SyntheticWorld world(SensorType::kMono);
  const SyntheticWorld::Picture first = world.Take(0);
  SyntheticWorld::Picture second = first;
  for (Keypoint& keypoint : second.features.keypoints) keypoint.angle = 64;
  second.features.keypoints[3].angle = 192;
  const FrameView first_view(first.features), second_view(second.features);
  const std::vector<Match> matches = {{0, 0, 0}, {1, 1, 0}, {2, 2, 0}, {3, 3, 0}};
  const auto kept = KeepRotationInliers(matches, first_view, second_view, {.check_rotation = true});
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_EQ(kept.back().first, 2);
  EXPECT_EQ(KeepRotationInliers(matches, first_view, second_view, {.check_rotation = false}).size(), 4U);
}

}  // namespace
}  // namespace tessera
