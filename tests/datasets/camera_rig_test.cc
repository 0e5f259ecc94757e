// Which calibrations make sense for which sensor.
#include "datasets/camera_rig.h"

#include <gtest/gtest.h>

#include "support/matchers.h"

namespace tessera {
namespace {

PinholeCamera Camera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 500.0, .fy_px = 500.0, .cx_px = 320.0, .cy_px = 240.0};
}

TEST(PinholeCamera, NeedsFocalLengthsAPrincipalPointAndWholeDistortion) {
  EXPECT_THAT(Camera().Check(), IsSuccess());
  PinholeCamera camera = Camera();
  camera.fx_px = 0.0;
  EXPECT_THAT(camera.Check(), IsFailure(HasSubstr("focal lengths")));
  camera = Camera();
  camera.height_px = 0;
  EXPECT_THAT(camera.Check(), IsFailure(HasSubstr("width and height")));
  camera = Camera();
  for (const size_t count : {0U, 4U, 5U, 8U}) {
    camera.distortion.assign(count, 0.01);
    EXPECT_THAT(camera.Check(), IsSuccess()) << count;
  }
  camera.distortion.assign(3, 0.01);
  EXPECT_THAT(camera.Check(), IsFailure(HasSubstr("not 3")));
  camera.lens = LensModel::kEquidistant;
  EXPECT_THAT(camera.Check(), IsFailure(HasSubstr("must have 4 numbers (k1 k2 k3 k4), not 3")));
  camera.distortion.assign(4, 0.01);
  EXPECT_THAT(camera.Check(), IsSuccess());
}

TEST(CameraRig, NeedsWhatItsSensorMeasuresWith) {
  CameraRig rig{.left = Camera()};
  EXPECT_THAT(rig.Check(SensorType::kMono), IsSuccess());
  EXPECT_THAT(rig.Check(SensorType::kRgbd), IsFailure(HasSubstr("depth unit")));
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsFailure(HasSubstr("right camera")));
  rig.depth_unit_m = 0.001;
  EXPECT_THAT(rig.Check(SensorType::kRgbd), IsSuccess());
  rig.right = Camera();
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsFailure(HasSubstr("same position")));
  rig.right_from_left.translation.x() = -0.1;
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsSuccess());
  rig.right->width_px = 320;
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsFailure(HasSubstr("one size")));
}

TEST(RectifiedPair, TheRightCameraStandsToTheRight) {
  const CameraRig rig = RectifiedPair(Camera(), 0.5);
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsSuccess());
  EXPECT_THAT(rig.right_from_left * Eigen::Vector3d(0.5, 0.0, 0.0), IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), 1e-12));
}

TEST(IsRotation, AllowsForLostDigitsButNotForMirrors) {
  const Eigen::Matrix3d rotation = ExpSO3({0.3, -0.2, 0.1}).toRotationMatrix();
  EXPECT_TRUE(IsRotation(rotation));
  EXPECT_TRUE(IsRotation((1000.0 * rotation).array().round() / 1000.0));
  EXPECT_FALSE(IsRotation(-rotation));
  EXPECT_FALSE(IsRotation(1.1 * rotation));
}

}  // namespace
}  // namespace tessera
