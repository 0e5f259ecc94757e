#include "map/landmark_colors.h"

#include <gtest/gtest.h>

#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr Rgb kRed{200, 10, 0}, kGreen{0, 110, 50};

// Keyframes 0 and 1, of frames 10 and 20, see landmark 5, each at its only keypoint.
class LandmarkColorsTest : public testing::Test {
 protected:
  void AddKeyframe(int64_t id, bool is_snapshot = false) {
    MapDelta delta{.is_snapshot = is_snapshot};
    delta.new_keyframes.push_back({{id}, {id - 1}, Rigid3(), PlainFeatures(10 + 10 * id, 1)});
    if (id == 0) delta.changed_landmarks = {{{5}, Landmark()}};
    delta.new_observations = {{{5}, {{id}, 0}}};
    delta = WithHash(map_, delta);
    ASSERT_THAT(map_.Apply(delta), IsSuccess());
    colors_.Receive(delta);
  }
  static ColorFrame Painted(int64_t frame, const Rgb& color) {
    return {.id = {frame}, .image = ColorImage(4, 3, color)};
  }
  std::optional<Rgb> Color() const { return colors_.Of(*map_.landmarks().Find({5})); }

  Map map_;
  LandmarkColors colors_;
};

TEST(ColorsAt, APixelIsAroundItsCenterAndTheNearestOneStandsForWhatIsOutside) {
  ColorImage image(2, 1, kRed);
  image.pixels[1] = kGreen;
  const std::vector<Keypoint> keypoints = {{.x_px = 0.4F}, {.x_px = 0.6F}, {.x_px = 9.0F, .y_px = -3.0F}};
  EXPECT_EQ(ColorsAt(keypoints, image), (std::vector<Rgb>{kRed, kGreen, kGreen}));
  EXPECT_TRUE(ColorsAt(keypoints, {}).empty());
}

TEST_F(LandmarkColorsTest, ALandmarkHasTheMeanColorOfItsObserversWhicheverComesFirst) {
  colors_.Receive(Painted(10, kRed));
  AddKeyframe(0);
  EXPECT_EQ(Color(), kRed);
  AddKeyframe(1);
  EXPECT_EQ(Color(), kRed);
  colors_.Receive(Painted(20, kGreen));
  EXPECT_EQ(Color(), (Rgb{100, 60, 25}));
}

TEST_F(LandmarkColorsTest, WhereNoColorIsKnownThereIsNone) {
  AddKeyframe(0);
  colors_.Receive(ColorFrame{.id = {10}});
  EXPECT_EQ(Color(), std::nullopt);
  EXPECT_TRUE(colors_.empty());
}

TEST_F(LandmarkColorsTest, TheFirstAnswerCounts) {
  AddKeyframe(0);
  colors_.Receive(Painted(10, kRed));
  colors_.Receive(ColorFrame{.id = {10}});  // of a camera that was started again
  EXPECT_EQ(Color(), kRed);
}

TEST_F(LandmarkColorsTest, KeyframesOfALoadedMapAreNotThoseOfThisRun) {
  AddKeyframe(0, /*is_snapshot=*/true);
  colors_.Receive(Painted(10, kRed));
  EXPECT_EQ(Color(), std::nullopt);
}

TEST_F(LandmarkColorsTest, WhoJoinsLateColorsTheKeyframesOfTheSnapshotWhicheverComesFirst) {
  for (const bool is_image_first : {false, true}) {
    map_ = Map();
    colors_ = LandmarkColors(/*joins_late=*/true);
    if (is_image_first) colors_.Receive(Painted(10, kRed));
    AddKeyframe(0, /*is_snapshot=*/true);
    if (!is_image_first) colors_.Receive(Painted(10, kRed));
    EXPECT_EQ(Color(), kRed) << is_image_first;
    AddKeyframe(1);
    colors_.Receive(Painted(20, kGreen));
    EXPECT_EQ(Color(), (Rgb{100, 60, 25})) << is_image_first;
  }
}

TEST_F(LandmarkColorsTest, AnImageOfAnotherTimeIsOfAnotherKeyframe) {
  colors_ = LandmarkColors(/*joins_late=*/true);
  AddKeyframe(0, /*is_snapshot=*/true);
  ColorFrame later = Painted(10, kRed);
  later.utime_us = 5;
  colors_.Receive(later);
  EXPECT_EQ(Color(), std::nullopt);
}

TEST_F(LandmarkColorsTest, ImagesThatWaitHaveABound) {
  constexpr int kSide = 4096;  // px: 48 MB
  for (const int64_t frame : {10, 20, 30}) {
    colors_.Receive(ColorFrame{.id = {frame}, .image = ColorImage(kSide, kSide, kRed)});
  }
  AddKeyframe(0);
  EXPECT_EQ(Color(), std::nullopt) << "the oldest is gone";
  AddKeyframe(1);
  EXPECT_EQ(Color(), kRed);
}

TEST_F(LandmarkColorsTest, ItIsCompleteWhenAllKeyframesAreAnswered) {
  EXPECT_TRUE(colors_.is_complete());
  colors_.Expect({10});
  colors_.Receive(Painted(20, kRed));
  EXPECT_FALSE(colors_.is_complete());
  colors_.Receive(ColorFrame{.id = {10}});
  EXPECT_TRUE(colors_.is_complete());
}

}  // namespace
}  // namespace tessera
