#include "measurement/landmark_description.h"

#include <gtest/gtest.h>

#include <cmath>

#include "map/map_editor.h"

namespace tessera {
namespace {

std::shared_ptr<const FeatureFrame> OneFeature(uint8_t level, const Descriptor& descriptor) {
  auto features = std::make_shared<FeatureFrame>();
  features->keypoints = {{.level = level}};
  features->descriptors = {descriptor};
  return features;
}

TEST(LandmarkDescription, FollowsFromTheObservations) {
  Map map;
  MapEditor editor(map);
  // Three cameras around a landmark at the origin; the second's descriptor lies between the others'.
  editor.AddKeyframe({0}, {}, {1.0, Eigen::Quaterniond::Identity(), {1, 0, -10}}, OneFeature(0, {0xFF, 0, 0, 0}));
  editor.AddKeyframe({1}, {0}, {1.0, Eigen::Quaterniond::Identity(), {0, 0, -10}}, OneFeature(1, {0x0F, 0, 0, 0}));
  editor.AddKeyframe({2}, {1}, {1.0, Eigen::Quaterniond::Identity(), {-1, 0, -10}}, OneFeature(2, {0x03, 0, 0, 0}));
  const LandmarkId id = editor.AddLandmark({});
  for (int64_t keyframe = 0; keyframe < 3; ++keyframe) editor.AddObservation(id, {{keyframe}, 0});

  const Landmark landmark = DescribeLandmark(map, id);
  EXPECT_LT((landmark.normal - Eigen::Vector3d(0, 0, -1)).norm(), 1e-12);
  EXPECT_NEAR(landmark.max_distance, std::sqrt(101.0) * 1.44, 1e-9);
  EXPECT_NEAR(landmark.max_distance / landmark.min_distance, std::pow(1.2, 7), 1e-9);
  EXPECT_EQ(landmark.descriptor, (Descriptor{0x0F, 0, 0, 0}));
}

}  // namespace
}  // namespace tessera
