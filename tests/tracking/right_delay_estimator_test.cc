#include "tracking/right_delay_estimator.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "measurement/right_delay.h"
#include "support/vga_camera.h"

namespace tessera {
namespace {

// Frames of a pair of cameras at the world's origin that turns by rates that change from frame to frame. It sees points
// of a keyframe that stood there. Its right images are taken `delay_s` later, and their columns corrected by what the
// estimator holds true.
class RightDelayEstimatorTest : public ::testing::Test {
 protected:
  RightDelayEstimatorTest() {
    replica_.Send(KeyframeId{0}, {KeyframeId{}, Rigid3::Identity(), {}});
    estimator_.AddKeyframe(KeyframeId{0}, CameraMotion{});
  }

  static CameraCalibration Camera() {
    CameraCalibration camera = VgaCamera(SensorType::kStereo);
    camera.baseline_m = 0.1;
    return camera;
  }

  CameraMotion Moving() {
    return {{0.3 * gaussian_(random_), 0.1 * gaussian_(random_), 0.3 * gaussian_(random_)},
            {0.1 * gaussian_(random_), 0.8 * gaussian_(random_), 0.1 * gaussian_(random_)}};
  }

  void Show(int num_frames, double delay_s) {
    for (int i = 0; i < num_frames; ++i) {
      const CameraMotion motion = Moving();
      estimator_.Add(FrameOf(motion, delay_s), motion, replica_);
    }
  }

  TrackedFrame FrameOf(const CameraMotion& motion, double delay_s) {
    FeatureFrame features;
    features.calibration = calibration_;
    const Rigid3 later_from_now = Rigid3{ExpSO3(delay_s * motion.turn_rate), delay_s * motion.velocity}.Inverse();
    std::vector<SeenPoint> points;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector2d pixel(100.0 + 540.0 * uniform_(random_), 480.0 * uniform_(random_));
      const Eigen::Vector3d point = (1.0 + 3.0 * uniform_(random_)) * Camera().Ray(pixel);
      const Eigen::Vector3d in_right = later_from_now * point - Eigen::Vector3d(Camera().baseline_m, 0.0, 0.0);
      features.keypoints.push_back({.x_px = static_cast<float>(pixel.x() + 0.3 * gaussian_(random_)),
                                    .y_px = static_cast<float>(pixel.y() + 0.3 * gaussian_(random_)),
                                    .right_x_px = static_cast<float>(Camera().Project(in_right).x() + squint_px_ +
                                                                     noise_px_ * gaussian_(random_))});
      SeenPoint seen_point{{LandmarkId{}, KeyframeId{0}, i}, {}};
      seen_point.landmark.position_in_world = point;
      points.push_back(seen_point);
    }
    features.descriptors.resize(features.keypoints.size());
    TrackedFrame frame(
        std::make_shared<const FrameView>(WithRightColumnsOfImage(features, estimator_.delay_s(), motion)));
    frame.points = std::move(points);
    return frame;
  }

  CameraCalibration calibration_ = Camera();
  double noise_px_ = 0.3, squint_px_ = 0.0;
  MapReplica replica_;
  RightDelayEstimator estimator_;
  std::mt19937 random_{7};
  std::normal_distribution<double> gaussian_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

TEST_F(RightDelayEstimatorTest, FindsHowMuchLaterTheRightImageIsTaken) {
  Show(100, 0.008);
  EXPECT_NEAR(estimator_.delay_s(), 0.008, 0.0003);
}

TEST_F(RightDelayEstimatorTest, OrEarlier) {
  Show(100, -0.003);
  EXPECT_NEAR(estimator_.delay_s(), -0.003, 0.0003);
}

TEST_F(RightDelayEstimatorTest, FollowsClocksThatDrift) {
  Show(100, 0.006);
  Show(200, 0.001);
  EXPECT_NEAR(estimator_.delay_s(), 0.001, 0.0003);
}

TEST_F(RightDelayEstimatorTest, CamerasThatAreTriggeredTogetherHaveNone) {
  Show(100, 0.0);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

TEST_F(RightDelayEstimatorTest, AFewFramesDontTellADelayFromNone) {
  Show(10, 0.008);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

// They look like a delay in each frame that turns, but not in many.
TEST_F(RightDelayEstimatorTest, ARightCameraThatSquintsIsNotLate) {
  squint_px_ = 1.0;
  Show(100, 0.0);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
  Show(100, 0.006);
  EXPECT_NEAR(estimator_.delay_s(), 0.006, 0.0003);
}

TEST_F(RightDelayEstimatorTest, ADelayThatExplainsLittleIsNone) {
  noise_px_ = 10.0;
  Show(100, 0.0015);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

// A map that was made while the camera moved is as wrong as its keyframes' right columns were.
TEST_F(RightDelayEstimatorTest, KnowsThatTheMapWasMadeByDelayedImagesToo) {
  const CameraMotion at_keyframe{{0.2, 0.0, 0.2}, {0.0, 0.5, 0.0}};
  estimator_.AddKeyframe(KeyframeId{0}, at_keyframe);
  for (int i = 0; i < 100; ++i) {
    const CameraMotion motion = Moving();
    TrackedFrame frame = FrameOf(motion, 0.003);
    for (SeenPoint& seen : frame.points) {
      Eigen::Vector3d& point = seen.landmark.position_in_world;
      const double disparity_px = Camera().fx_px * Camera().baseline_m / point.z();
      point *= 1.0 + 0.7 * 0.003 * RightColumnRate(Camera(), point, at_keyframe) / disparity_px;
    }
    estimator_.Add(frame, motion, replica_);
  }
  EXPECT_NEAR(estimator_.delay_s(), 0.003, 0.0003);
}

TEST_F(RightDelayEstimatorTest, TheFirstStepTellsHowAKeyframeMoved) {
  estimator_.AddKeyframe(KeyframeId{0}, std::nullopt);
  Show(100, 0.006);
  EXPECT_NE(estimator_.delay_s(), 0.0);
}

TEST_F(RightDelayEstimatorTest, PointsOfAKeyframeWhoseMotionNobodyKnowsTellNothing) {
  estimator_.AddKeyframe(KeyframeId{0}, std::nullopt);
  estimator_.ForgetMotion();
  Show(100, 0.008);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

TEST_F(RightDelayEstimatorTest, ADepthCameraIsNotAsked) {
  calibration_.sensor = SensorType::kRgbd;
  Show(100, 0.008);
  EXPECT_EQ(estimator_.delay_s(), 0.0);
}

}  // namespace
}  // namespace tessera
