#include "datasets/rectifier.h"

#include <algorithm>
#include <cmath>

#include "support/dataset_folder.h"
#include "support/matchers.h"

namespace tessera {
namespace {

// The EuRoC pair's cameras.
CameraRig WideAnglePair() {
  CameraRig rig;
  rig.left = {752, 480, 458.654, 457.296, 367.215, 248.375, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
  rig.right = {752, 480, 457.587, 456.134, 379.999, 255.238, {-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05}};
  rig.right_from_left = {ExpSO3({-0.0141, 0.00036, -0.0023}), {-0.110074, 0.0004, -0.00085}};
  return rig;
}

// The fisheye pair of the TUM visual-inertial benchmark, about: 512x512, of 195 degrees.
CameraRig FisheyePair() {
  CameraRig rig;
  rig.left = {512, 512, 190.98, 190.97, 254.93, 256.90, {0.00348, 0.00072, -0.00205, 0.00020}, LensModel::kEquidistant};
  rig.right = {512, 512, 190.44, 190.43, 252.60, 254.92, {0.0034, 0.0018, -0.0027, 0.00033}, LensModel::kEquidistant};
  rig.right_from_left = {ExpSO3({0.0141, -0.0010, 0.0023}), {-0.1011, -0.0020, -0.0010}};
  return rig;
}

// The camera models as camera_rig.h states them.
Eigen::Vector2d ProjectFisheye(const PinholeCamera& camera, const Eigen::Vector3d& point) {
  const double x = point.x() / point.z(), y = point.y() / point.z(), r = std::hypot(x, y), t = std::atan(r);
  const std::vector<double>& d = camera.distortion;
  const double t2 = t * t;
  const double c = r < 1e-9 ? 1.0 : t * (1.0 + t2 * (d[0] + t2 * (d[1] + t2 * (d[2] + t2 * d[3])))) / r;
  return {camera.fx_px * x * c + camera.cx_px, camera.fy_px * y * c + camera.cy_px};
}

Eigen::Vector2d ProjectDistorted(const PinholeCamera& camera, const Eigen::Vector3d& point) {
  if (camera.lens == LensModel::kEquidistant) return ProjectFisheye(camera, point);
  const double x = point.x() / point.z(), y = point.y() / point.z(), r2 = x * x + y * y;
  const std::vector<double>& d = camera.distortion;
  const double radial = 1.0 + d[0] * r2 + d[1] * r2 * r2;
  return {camera.fx_px * (x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x)) + camera.cx_px,
          camera.fy_px * (y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y) + camera.cy_px};
}

GrayImage DrawSpot(const PinholeCamera& camera, const Eigen::Vector2d& center) {
  GrayImage image(camera.width_px, camera.height_px);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double distance2 = (Eigen::Vector2d(x, y) - center).squaredNorm();
      image.row(y)[x] = static_cast<uint8_t>(std::lround(250.0 * std::exp(-distance2 / 32.0)));
    }
  }
  return image;
}

Eigen::Vector2d FindSpot(const GrayImage& image) {
  Eigen::Vector2d sum(0.0, 0.0);
  double weight = 0.0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      sum += image.row(y)[x] * Eigen::Vector2d(x, y);
      weight += image.row(y)[x];
    }
  }
  return sum / weight;
}

const std::vector<Eigen::Vector3d> kPoints = {
    {0.0, 0.0, 3.0}, {1.0, 0.5, 3.0}, {-1.2, -0.7, 3.5}, {-0.8, 0.9, 4.0}, {2.0, -1.0, 6.0}};

TEST(Rectifier, PassesUndistortedImagesUnchanged) {
  PinholeCamera camera{40, 30, 50.0, 50.0, 20.0, 15.0, {}};
  const GrayImage image = ToGray(DatasetFolder::Pattern(40, 30, 1));
  const Rectifier mono({.left = camera}, SensorType::kMono);
  EXPECT_TRUE(mono.is_identity());
  EXPECT_EQ(mono.Left(image), image);
  const Rectifier stereo(RectifiedPair(camera, 0.5), SensorType::kStereo);
  EXPECT_TRUE(stereo.is_identity());
  EXPECT_EQ(stereo.Right(image), image);
  EXPECT_EQ(stereo.calibration().baseline_m, 0.5);
  EXPECT_EQ(stereo.calibration().fx_px, 50.0);
  EXPECT_THAT(stereo.calibration().Check(), IsSuccess());
}

// Wide-angle and fisheye pairs alike.
class RectifierOf : public testing::TestWithParam<CameraRig (*)()> {};
INSTANTIATE_TEST_SUITE_P(Lens, RectifierOf, testing::Values(WideAnglePair, FisheyePair));

TEST_P(RectifierOf, MonoImageIsThatOfThePinhole) {
  const CameraRig rig = GetParam()();
  const Rectifier rectifier(rig, SensorType::kMono);
  for (const Eigen::Vector3d& point : kPoints) {
    const GrayImage image = rectifier.Left(DrawSpot(rig.left, ProjectDistorted(rig.left, point)));
    EXPECT_LT((FindSpot(image) - rectifier.calibration().Project(point)).norm(), 0.2) << point.transpose();
  }
}

TEST_P(RectifierOf, PairSeesPointsInOneRowWithTheDisparityOfTheirDepth) {
  const CameraRig rig = GetParam()();
  const Rectifier rectifier(rig, SensorType::kStereo);
  const CameraCalibration& calibration = rectifier.calibration();
  EXPECT_NEAR(calibration.baseline_m, rig.right_from_left.translation.norm(), 1e-9);
  for (const Eigen::Vector3d& point : kPoints) {
    const Eigen::Vector3d point_in_rectified = rectifier.left_from_rectified().Inverse() * point;
    const Eigen::Vector2d left = FindSpot(rectifier.Left(DrawSpot(rig.left, ProjectDistorted(rig.left, point))));
    const Eigen::Vector2d right =
        FindSpot(rectifier.Right(DrawSpot(*rig.right, ProjectDistorted(*rig.right, rig.right_from_left * point))));
    EXPECT_LT((left - calibration.Project(point_in_rectified)).norm(), 0.2) << point.transpose();
    EXPECT_NEAR(left.y(), right.y(), 0.1) << point.transpose();
    EXPECT_NEAR(left.x() - right.x(), calibration.fx_px * calibration.baseline_m / point_in_rectified.z(), 0.15);
  }
}

TEST_P(RectifierOf, LeavesNoBlackBorder) {
  const CameraRig rig = GetParam()();
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    const Rectifier rectifier(rig, sensor);
    const GrayImage white(rig.left.width_px, rig.left.height_px, 255);
    const GrayImage left = rectifier.Left(white);
    EXPECT_EQ(*std::min_element(left.pixels.begin(), left.pixels.end()), 255) << ToString(sensor);
    if (sensor == SensorType::kStereo) {
      const GrayImage right = rectifier.Right(white);
      EXPECT_EQ(*std::min_element(right.pixels.begin(), right.pixels.end()), 255);
    }
  }
}

// Else it would be blurred for a view to the sides that is stretched beyond use.
TEST(Rectifier, TheMiddleOfAFisheyeImageKeepsItsResolution) {
  const Rectifier mono(FisheyePair(), SensorType::kMono);
  EXPECT_NEAR(mono.calibration().fx_px, 190.98, 1.0);
  const Rectifier stereo(FisheyePair(), SensorType::kStereo);
  EXPECT_NEAR(stereo.calibration().fx_px, 190.43, 1.0);
}

TEST(Rectifier, NeverMixesDepths) {
  CameraRig rig = WideAnglePair();
  rig.depth_unit_m = 0.001;
  const Rectifier rectifier(rig, SensorType::kRgbd);
  EXPECT_EQ(rectifier.calibration().depth_unit_m, 0.001);
  DepthImage depth(752, 480, 1000);
  for (int y = 0; y < 480; ++y) {
    std::fill_n(depth.row(y) + 376, 376, uint16_t{3000});
  }
  for (const uint16_t count : rectifier.Depth(depth).pixels) {
    ASSERT_TRUE(count == 1000 || count == 3000) << count;
  }
}

// Color and depth of a new pixel come from the same place of the old images, and depth from the nearest pixel there.
TEST(Rectifier, DepthStaysOnTheColorImage) {
  CameraRig rig = WideAnglePair();
  rig.depth_unit_m = 0.001;
  const Rectifier rectifier(rig, SensorType::kRgbd);
  const CameraCalibration& calibration = rectifier.calibration();
  DepthImage columns(752, 480), rows(752, 480);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 752; ++x) {
      columns.row(y)[x] = static_cast<uint16_t>(x);
      rows.row(y)[x] = static_cast<uint16_t>(y);
    }
  }
  columns = rectifier.Depth(std::move(columns));
  rows = rectifier.Depth(std::move(rows));
  const double tolerance_px = 0.5 + 1.0 / 32.0;  // the tables' step
  for (int y = 0; y < 480; y += 7) {
    for (int x = 0; x < 752; x += 7) {
      const Eigen::Vector3d ray((x - calibration.cx_px) / calibration.fx_px,
                                (y - calibration.cy_px) / calibration.fy_px, 1.0);
      const Eigen::Vector2d from = ProjectDistorted(rig.left, ray);
      ASSERT_NEAR(columns.row(y)[x], from.x(), tolerance_px) << x << ' ' << y;
      ASSERT_NEAR(rows.row(y)[x], from.y(), tolerance_px) << x << ' ' << y;
    }
  }
}

TEST(Rectifier, RefusesExchangedCameras) {
  CameraRig rig = WideAnglePair();
  std::swap(rig.left, *rig.right);
  rig.right_from_left = rig.right_from_left.Inverse();
  ExpectInputError([&] { Rectifier(rig, SensorType::kStereo); }, {"exchange the cameras"});
}

}  // namespace
}  // namespace tessera
