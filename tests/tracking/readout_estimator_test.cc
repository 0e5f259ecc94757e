#include "tracking/readout_estimator.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "support/vga_camera.h"

namespace tessera {
namespace {

CameraMotion Turning() { return {Eigen::Vector3d::Zero(), {0.0, 1.0, 0.0}}; }

// Frames of a camera at the world's origin that turns by rates that change from frame to frame. It sees points that are
// known, its images take `readout` to be read, and its keypoints are moved by what the estimator holds true.
class ReadoutEstimatorTest : public ::testing::Test {
 protected:
  void Show(int num_frames, const Readout& readout) {
    for (int i = 0; i < num_frames; ++i) {
      const CameraMotion motion{Eigen::Vector3d::Zero(),
                                {0.1 * gaussian_(random_), 0.8 * gaussian_(random_), 0.1 * gaussian_(random_)}};
      estimator_.Add(FrameOf(motion, readout), motion, {Rigid3::Identity(), CameraMotion{}});
    }
  }

  TrackedFrame FrameOf(const CameraMotion& motion, const Readout& readout) {
    FeatureFrame features;
    features.calibration = camera_;
    std::vector<SeenPoint> points;
    std::vector<double> depths;
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector2d pixel(640.0 * uniform_(random_), 480.0 * uniform_(random_));
      const Eigen::Vector3d point = (1.0 + 3.0 * uniform_(random_)) * camera_.Ray(pixel);
      const double time_s = ReadTime(readout, camera_, pixel);
      const Eigen::Vector2d seen = camera_.Project(ExpSO3(-time_s * motion.turn_rate) * point);
      Keypoint keypoint;
      keypoint.x_px = static_cast<float>(seen.x() + noise_px_ * gaussian_(random_));
      keypoint.y_px = static_cast<float>(seen.y() + noise_px_ * gaussian_(random_));
      features.keypoints.push_back(keypoint);
      depths.push_back(point.z());
      SeenPoint seen_point{{LandmarkId{i}, {}, -1}, {}};
      seen_point.landmark.position_in_world = point;
      points.push_back(seen_point);
    }
    features.descriptors.resize(features.keypoints.size());
    TrackedFrame frame(std::make_shared<const FrameView>(Unroll(features, depths, estimator_.readout(), motion)));
    frame.points = std::move(points);
    return frame;
  }

  CameraCalibration camera_ = VgaCamera(SensorType::kMono);
  double noise_px_ = 0.5;
  ReadoutEstimator estimator_;
  std::mt19937 random_{7};
  std::normal_distribution<double> gaussian_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

struct ReadCase {
  const char* name;  // of the camera
  Readout readout;
};

class WaysToReadTest : public ReadoutEstimatorTest, public ::testing::WithParamInterface<ReadCase> {};

TEST_P(WaysToReadTest, AreFound) {
  const Readout& readout = GetParam().readout;
  Show(200, readout);
  EXPECT_NEAR(estimator_.readout().down_s, readout.down_s, readout.down_s != 0.0 ? 0.001 : 0.0);
  EXPECT_NEAR(estimator_.readout().across_s, readout.across_s, readout.across_s != 0.0 ? 0.001 : 0.0);
}

INSTANTIATE_TEST_SUITE_P(OfACamera, WaysToReadTest,
                         ::testing::Values(ReadCase{"Upright", {.down_s = 0.025}},
                                           ReadCase{"UpsideDown", {.down_s = -0.025}},
                                           ReadCase{"OnItsSide", {.across_s = 0.025}},
                                           ReadCase{"OnItsOtherSide", {.across_s = -0.025}}),
                         [](const auto& read_case) { return read_case.param.name; });

// As of a camera that turns about the vertical in a map that isn't exact.
TEST_F(ReadoutEstimatorTest, ColumnsThatExplainLittleOfWhatIsSeenArentReadSo) {
  noise_px_ = 10.0;
  Show(400, {.across_s = 0.012});
  EXPECT_EQ(estimator_.readout(), Readout{});
}

// As over a plane, where a map that only images made bends with the way.
TEST_F(ReadoutEstimatorTest, InMonoRowsThatExplainLittleArentReadSo) {
  noise_px_ = 20.0;
  Show(400, {.down_s = 0.012});
  EXPECT_EQ(estimator_.readout(), Readout{});
  camera_.sensor = SensorType::kRgbd;
  Show(400, {.down_s = 0.012});
  EXPECT_NEAR(estimator_.readout().down_s, 0.012, 0.004);
}

TEST_F(ReadoutEstimatorTest, HowImagesAreReadStaysAsItWasFound) {
  Show(200, {.across_s = 0.025});
  Show(400, {.down_s = 0.025});
  EXPECT_EQ(estimator_.readout().down_s, 0.0);
}

TEST_F(ReadoutEstimatorTest, AFewFramesDontTellAReadoutFromNone) {
  Show(3, {.down_s = 0.025});
  EXPECT_EQ(estimator_.readout(), Readout{});
}

TEST_F(ReadoutEstimatorTest, AGlobalShutterHasNone) {
  Show(200, {});
  EXPECT_EQ(estimator_.readout(), Readout{});
}

TEST_F(ReadoutEstimatorTest, FramesOfFewPointsTellNothing) {
  TrackedFrame frame = FrameOf(Turning(), {.down_s = 0.025});
  for (size_t i = 40; i < frame.points.size(); ++i) frame.points[i] = {};
  for (int i = 0; i < 100; ++i) estimator_.Add(frame, Turning(), {});
  EXPECT_EQ(estimator_.readout(), Readout{});
}

}  // namespace
}  // namespace tessera
