#include "features/erase_keypoints.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(EraseKeypoints, TheOthersKeepTheirOrderAndTheirDescriptors) {
  FeatureFrame features;
  for (size_t i = 0; i < 6; ++i) {
    features.keypoints.push_back({.x_px = static_cast<float>(i)});
    features.descriptors.push_back({i, 0, 0, 0});
  }
  EraseKeypoints(features, [](size_t i) { return i == 0 || i == 3 || i == 5; });
  ASSERT_EQ(features.keypoints.size(), 3U);
  ASSERT_EQ(features.descriptors.size(), 3U);
  const size_t left[] = {1, 2, 4};
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(features.keypoints[k].x_px, static_cast<float>(left[k]));
    EXPECT_EQ(features.descriptors[k][0], left[k]);
  }
}

}  // namespace
}  // namespace tessera
