// Stereo pairs whose cameras expose each by itself.
#include "features/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "support/feature_images.h"

namespace tessera {
namespace {

GrayImage Changed(GrayImage image, const std::function<double(double value, int x, int y)>& change) {
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double value = std::round(change(image.row(y)[x], x, y));
      image.row(y)[x] = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  return image;
}

struct StereoMatches {
  double num = 0.0;          // keypoints that were found in the right image
  double share_alike = 0.0;  // of them: where they were found in the pair as it was, to a quarter of a pixel
};

class StereoPair : public testing::Test {
 protected:
  FeatureFrame Extract(const GrayImage& right) const {
    CameraFrame frame = frame_;
    frame.right = right;
    return ExtractWhole(frame, {});
  }
  StereoMatches Match(const GrayImage& right) const {
    const FeatureFrame before = Extract(frame_.right), now = Extract(right);
    StereoMatches matches;
    for (size_t i = 0; i < now.keypoints.size(); ++i) {
      const Keypoint &a = before.keypoints[i], &b = now.keypoints[i];
      if (std::isnan(b.right_x_px)) continue;
      matches.num += 1.0;
      matches.share_alike += std::abs(a.right_x_px - b.right_x_px) < 0.25F ? 1.0 : 0.0;
    }
    matches.share_alike /= std::max(1.0, matches.num);
    return matches;
  }
  void ExpectAlike(const GrayImage& right) const {
    const StereoMatches matches = Match(right);
    EXPECT_GT(matches.num, 0.85 * Match(frame_.right).num);
    EXPECT_GT(matches.share_alike, 0.9);
  }

  const CameraFrame frame_ = MakeFrame(SensorType::kStereo, MakeTexture(640, 400, 5));
};

TEST_F(StereoPair, MatchesHalfAsBright) {
  ExpectAlike(Changed(frame_.right, [](double value, int, int) { return 0.5 * value; }));
}

TEST_F(StereoPair, MatchesWithLessContrastAndBrighterByForty) {
  ExpectAlike(Changed(frame_.right, [](double value, int, int) { return 0.7 * value + 40.0; }));
}

TEST_F(StereoPair, MatchesThroughALensThatIsDarkAtTheEdges) {
  ExpectAlike(Changed(frame_.right, [](double value, int x, int y) {
    const double radius = std::hypot(x - 320.0, y - 200.0) / 377.0;
    return value * (1.0 - 0.2 * radius * radius);
  }));
}

TEST_F(StereoPair, OfOneExposureStaysAsItIs) {
  GrayImage right = frame_.right;
  MatchExposure(frame_.left, right);
  EXPECT_EQ(right, frame_.right);
}

TEST(MatchExposure, TakesBackWhatAnotherGainDid) {
  const GrayImage left = MakeTexture(320, 200, 6);
  GrayImage right = Changed(left, [](double value, int, int) { return 0.6 * value + 20.0; });
  MatchExposure(left, right);
  double sum = 0.0;
  for (size_t i = 0; i < left.pixels.size(); ++i) sum += std::abs(left.pixels[i] - right.pixels[i]);
  EXPECT_LT(sum / static_cast<double>(left.pixels.size()), 2.0);
}

TEST(MatchExposure, LeavesWhatSaysNothing) {
  const GrayImage left = MakeTexture(320, 200, 6);
  for (const uint8_t value : {uint8_t{0}, uint8_t{90}, uint8_t{255}}) {
    GrayImage flat = MakeFlat(320, 200, value);
    MatchExposure(left, flat);
    EXPECT_EQ(flat, MakeFlat(320, 200, value));
  }
  GrayImage none;
  MatchExposure(none, none);
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace tessera
