#include "tracking/depth_delay_estimator.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "measurement/depth_delay.h"
#include "support/vga_camera.h"

namespace tessera {
namespace {

const Eigen::Vector3d kFloor(0.05, 0.45, 0.4);  // a . point = 1, in the world

CameraCalibration Camera() { return VgaCamera(SensorType::kRgbd); }

// Frames of a camera at the world's origin that turns by rates that change from frame to frame, in front of a slanted
// surface whose points are known. Its depths are measured `delay_s` later and corrected by what the estimator holds
// true.
class DepthDelayEstimatorTest : public ::testing::Test {
 protected:
  CameraMotion Turning() {
    return {{0.2 * gaussian_(random_), 0.1 * gaussian_(random_), 0.2 * gaussian_(random_)},
            {0.8 * gaussian_(random_), 0.8 * gaussian_(random_), 0.1 * gaussian_(random_)}};
  }

  void Show(int num_frames, double delay_s) {
    for (int i = 0; i < num_frames; ++i) {
      const CameraMotion motion = Turning();
      estimator_.Add(FrameOf(motion, delay_s), motion, {Rigid3::Identity(), CameraMotion{}});
    }
  }

  TrackedFrame FrameOf(const CameraMotion& motion, double delay_s) {
    const Rigid3 image_from_depth{ExpSO3(delay_s * motion.turn_rate), delay_s * motion.velocity};
    const Eigen::Vector3d floor_later = SurfaceIn(image_from_depth, kFloor);
    FeatureFrame features;
    features.calibration = Camera();
    std::vector<SeenPoint> points;
    for (int i = 0; i < 600; ++i) {
      const Eigen::Vector2d pixel(640.0 * uniform_(random_), 60.0 + 420.0 * uniform_(random_));
      const Eigen::Vector3d ray = Camera().Ray(pixel);
      const double inverse_depth = floor_later.dot(ray) * (1.0 + 0.002 * gaussian_(random_));
      features.keypoints.push_back({.x_px = static_cast<float>(pixel.x() + 0.5 * gaussian_(random_)),
                                    .y_px = static_cast<float>(pixel.y() + 0.5 * gaussian_(random_)),
                                    .depth_m = static_cast<float>(1.0 / inverse_depth)});
      SeenPoint seen_point{{LandmarkId{i}, {}, -1}, {}};
      seen_point.landmark.position_in_world = ray / kFloor.dot(ray);
      points.push_back(seen_point);
    }
    features.descriptors.resize(features.keypoints.size());
    const FrameView measured(features);
    TrackedFrame frame(std::make_shared<const FrameView>(
        WithDepthsOfImage(measured, SurfacesOf(measured), estimator_.delay_s(), motion)));
    frame.points = std::move(points);
    return frame;
  }

  DepthDelayEstimator estimator_;
  std::mt19937 random_{7};
  std::normal_distribution<double> gaussian_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

TEST_F(DepthDelayEstimatorTest, FindsHowMuchLaterDepthsAreMeasured) {
  Show(150, 0.012);
  EXPECT_NEAR(estimator_.delay_s(), 0.012, 0.001);
}

TEST_F(DepthDelayEstimatorTest, OrEarlier) {
  Show(150, -0.008);
  EXPECT_NEAR(estimator_.delay_s(), -0.008, 0.001);
}

TEST_F(DepthDelayEstimatorTest, FollowsADelayThatDrifts) {
  Show(150, 0.010);
  Show(300, 0.004);
  EXPECT_NEAR(estimator_.delay_s(), 0.004, 0.001);
}

TEST_F(DepthDelayEstimatorTest, AFewFramesDontTellADelayFromNone) {
  Show(2, 0.012);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

TEST_F(DepthDelayEstimatorTest, ImagesAndDepthsOfOneMomentHaveNone) {
  Show(150, 0.0);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

// The map would be as wrong as the frame.
TEST_F(DepthDelayEstimatorTest, ACameraThatMovesAsAtItsReferenceSaysNothing) {
  for (int i = 0; i < 150; ++i) {
    const CameraMotion motion = Turning();
    estimator_.Add(FrameOf(motion, 0.012), motion, {Rigid3::Identity(), motion});
  }
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

TEST_F(DepthDelayEstimatorTest, AStereoCameraIsNotAsked) {
  for (int i = 0; i < 150; ++i) {
    const CameraMotion motion = Turning();
    TrackedFrame frame = FrameOf(motion, 0.012);
    FeatureFrame features = frame.view->features();
    features.calibration.sensor = SensorType::kStereo;
    features.calibration.baseline_m = 0.1;
    frame.view = std::make_shared<const FrameView>(features);
    estimator_.Add(frame, motion, {});
  }
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

}  // namespace
}  // namespace tessera
