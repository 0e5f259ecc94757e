#include "measurement/landmark_description.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "map/map_editor.h"
#include "measurement/keypoint_measurement.h"

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

// A landmark 10 m ahead of cameras at these positions, which look along z; they see it where it stands.
class SeenLandmark {
 public:
  explicit SeenLandmark(const std::vector<Eigen::Vector3d>& cameras, uint8_t level = 0,
                        SensorType sensor = SensorType::kMono, double depth = 10.0) {
    MapEditor editor(map_);
    id_ = editor.AddLandmark({.position_in_world = {0.0, 0.0, depth}});
    for (const Eigen::Vector3d& camera : cameras) {
      auto features = std::make_shared<FeatureFrame>();
      features->calibration = {.sensor = sensor, .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500};
      const Eigen::Vector3d in_camera = Eigen::Vector3d(0.0, 0.0, depth) - camera;
      const Eigen::Vector2d pixel = features->calibration.Project(in_camera);
      features->keypoints = {
          {.x_px = static_cast<float>(pixel.x()), .y_px = static_cast<float>(pixel.y()), .level = level}};
      if (sensor == SensorType::kRgbd) features->keypoints[0].depth_m = static_cast<float>(in_camera.z());
      features->descriptors.resize(1);
      const KeyframeId keyframe{map_.keyframes().end_id()};
      editor.AddKeyframe(keyframe, {keyframe.value - 1}, {1.0, Eigen::Quaterniond::Identity(), camera}, features);
      editor.AddObservation(id_, {keyframe, 0});
    }
  }
  Landmark Describe() const { return DescribeMovedLandmark(map_, id_); }
  double DepthSigma() const { return Describe().depth_sigma; }

 private:
  Map map_;
  LandmarkId id_;
};

// Two pairs of cameras, a baseline apart, see the depth of a point between them up to  z^2 / (f baseline) sigma_px.
TEST(DepthSigma, IsThatOfATriangulation) {
  const Eigen::Vector3d left(-0.5, 0, 0), right(0.5, 0, 0);
  const double expected = 10.0 * 10.0 / (500.0 * 1.0) * KeypointSigmaPx(SensorType::kMono);
  EXPECT_NEAR(SeenLandmark({left, right, left, right}).DepthSigma() / expected, 1.0, 0.01);
}

// Two views agree on some depth whatever they see; a third one confirms it.
TEST(DepthSigma, OfTwoViewsIsHalfTheDistanceAtLeast) {
  const Eigen::Vector3d left(-0.5, 0, 0), right(0.5, 0, 0);
  const SeenLandmark of_two({left, right});
  EXPECT_NEAR(of_two.DepthSigma(), 0.5 * (right - Eigen::Vector3d(0.0, 0.0, 10.0)).norm(), 1e-9);
  EXPECT_LT(SeenLandmark({left, right, left}).DepthSigma(), 0.2);
  EXPECT_LT(SeenLandmark({left, right}, 0, SensorType::kRgbd).DepthSigma(), 0.5);  // each has a depth of its own
}

TEST(DepthSigma, FallsWithTheParallax) {
  const double narrow = SeenLandmark({{-0.2, 0, 0}, {0.2, 0, 0}, {-0.2, 0, 0}, {0.2, 0, 0}}).DepthSigma();
  const double wide = SeenLandmark({{-0.8, 0, 0}, {0.8, 0, 0}, {-0.8, 0, 0}, {0.8, 0, 0}}).DepthSigma();
  EXPECT_NEAR(narrow / wide, 4.0, 0.1);
}

TEST(DepthSigma, FallsWithTheNumberOfObservers) {
  const Eigen::Vector3d left(-0.5, 0, 0), right(0.5, 0, 0);
  const double of_four = SeenLandmark({left, right, left, right}).DepthSigma();
  EXPECT_NEAR(SeenLandmark({left, right, left, right, left, right, left, right}).DepthSigma(), of_four / std::sqrt(2.0),
              1e-9);
}

TEST(DepthSigma, GrowsWithTheKeypointsNoise) {
  const std::vector<Eigen::Vector3d> cameras{{-0.5, 0, 0}, {0.5, 0, 0}, {-0.5, 0, 0}};
  EXPECT_NEAR(SeenLandmark(cameras, 2).DepthSigma(), 1.44 * SeenLandmark(cameras, 0).DepthSigma(), 1e-9);
}

// Of a point that was seen from one side only, nothing but the direction is known: its depth is anyone's guess.
TEST(DepthSigma, WithoutParallaxIsAMultipleOfTheDistance) {
  EXPECT_DOUBLE_EQ(SeenLandmark({{0, 0, 0}}).DepthSigma(), kMaxDepthShare * 10.0);
  EXPECT_DOUBLE_EQ(SeenLandmark({{0, 0, 0}, {0, 0, 0}}).DepthSigma(), kMaxDepthShare * 10.0);
  EXPECT_GT(SeenLandmark({{-1e-3, 0, 0}, {1e-3, 0, 0}}).DepthSigma(), 50.0);
  EXPECT_EQ(DepthSigma(0.0, 7.0), kMaxDepthShare * 7.0);
  EXPECT_EQ(DepthSigma(4.0, 7.0), 0.5);
}

TEST(HasDepth, UnlessTheDistanceMayBeAny) {
  Landmark landmark{.position_in_world = {0, 0, 10.0}, .depth_sigma = 5.0};
  EXPECT_TRUE(HasDepth(landmark, {0, 0, 0}));
  EXPECT_FALSE(HasDepth(landmark, {0, 0, 5.0})) << "5 m off, known to 5 m";
  landmark.depth_sigma = 10.0;
  EXPECT_FALSE(HasDepth(landmark, {0, 0, 0}));
}

TEST(DepthSigma, ACameraThatTheLandmarkStandsBehindSaysNothing) {
  const Landmark landmark = SeenLandmark({{-0.5, 0, 0}, {0.5, 0, 0}}).Describe();
  FeatureFrame features;
  features.calibration = {.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500};
  features.keypoints.resize(1);
  const Rigid3 ahead{Eigen::Quaterniond::Identity(), {0.0, 1.0, 20.0}}, behind{ahead.rotation, {0.0, 1.0, 0.0}};
  EXPECT_EQ(DepthInformation(features, 0, ahead, landmark), 0.0);
  EXPECT_GT(DepthInformation(features, 0, behind, landmark), 0.0);
}

// One depth of a depth camera fixes it up to the disparity's own sigma, whatever the keypoint's level.
TEST(DepthSigma, OfADepthSensorIsThatOfItsDisparity) {
  for (const double depth : {1.0, 3.0}) {
    const double expected = depth * depth / (500.0 * kRgbdBaseline) * kRgbdDisparitySigmaPx;
    for (const uint8_t level : {uint8_t{0}, uint8_t{4}}) {
      EXPECT_NEAR(SeenLandmark({{0, 0, 0}}, level, SensorType::kRgbd, depth).DepthSigma() / expected, 1.0, 1e-6);
    }
  }
}

TEST(InWorld, AllLengthsFollowTheScale) {
  const Sim3 world_from_keyframe{2.5, Eigen::Quaterniond(ExpSO3({0.1, 0.2, -0.3})), {1.0, 2.0, 3.0}};
  const Landmark before = SeenLandmark({{-0.5, 0, 0}, {0.5, 0, 0}}).Describe();
  const Landmark after = InWorld(world_from_keyframe, before);
  EXPECT_DOUBLE_EQ(after.depth_sigma, 2.5 * before.depth_sigma);
  EXPECT_DOUBLE_EQ(after.min_distance, 2.5 * before.min_distance);
  EXPECT_DOUBLE_EQ(after.max_distance, 2.5 * before.max_distance);
  EXPECT_NEAR(after.normal.norm(), 1.0, 1e-12);
}

}  // namespace
}  // namespace tessera
