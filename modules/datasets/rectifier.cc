#include "datasets/rectifier.h"

#include <algorithm>
#include <opencv2/calib3d.hpp>

#include "core/errors.h"
#include "datasets/remap_table.h"

namespace tessera {
namespace {

cv::Mat CameraMatrix(const PinholeCamera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0);
}

Eigen::Matrix3d ToEigen(const cv::Mat& matrix) {
  Eigen::Matrix3d result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      result(row, column) = matrix.at<double>(row, column);
    }
  }
  return result;
}

bool IsRectifiedPair(const CameraRig& rig) {
  const PinholeCamera& left = rig.left;
  const PinholeCamera& right = *rig.right;
  const Rigid3& move = rig.right_from_left;
  return left.distortion.empty() && right.distortion.empty() && left.fx_px == right.fx_px &&
         left.fy_px == right.fy_px && left.cx_px == right.cx_px && left.cy_px == right.cy_px &&
         move.rotation.coeffs() == Eigen::Quaterniond::Identity().coeffs() && move.translation.x() < 0.0 &&
         move.translation.y() == 0.0 && move.translation.z() == 0.0;
}

// Where in the original image each pixel of the new one lies, in OpenCV's maps of that type.
void MapPixels(const PinholeCamera& camera, const cv::Mat& new_from_camera, const cv::Mat& new_camera, int type,
               cv::Mat& map1, cv::Mat& map2) {
  const cv::Mat matrix = CameraMatrix(camera);
  const cv::Size size(camera.width_px, camera.height_px);
  if (camera.lens == LensModel::kEquidistant) {
    cv::fisheye::initUndistortRectifyMap(matrix, camera.distortion, new_from_camera, new_camera, size, type, map1,
                                         map2);
  } else {
    cv::initUndistortRectifyMap(matrix, camera.distortion, new_from_camera, new_camera, size, type, map1, map2);
  }
}

// Whether each pixel of the new image comes from inside the original one.
bool SeesOnlyImage(const PinholeCamera& camera, const cv::Mat& rotation, const cv::Mat& new_camera) {
  cv::Mat x_px, y_px;
  MapPixels(camera, rotation, new_camera, CV_32FC1, x_px, y_px);
  return cv::checkRange(x_px, true, nullptr, 0.0, camera.width_px - 1 + 1e-3) &&
         cv::checkRange(y_px, true, nullptr, 0.0, camera.height_px - 1 + 1e-3);
}

constexpr double kNoBorder = 0.0;   // cv::stereoRectify's alpha: so large that nothing beside the images is seen
constexpr double kOwnFocal = -1.0;  // likewise: the focal length stays

// OpenCV fits the new image into the original at a few points of its border only, so that up to two pixels
// beside them stay black. This narrows the view until none is.
constexpr double kZoomStep = 1.002;
constexpr int kMaxZoomSteps = 200;

void ZoomIn(cv::Mat& projection) {
  projection.row(0).colRange(0, 2) *= kZoomStep;
  projection.row(1).colRange(0, 2) *= kZoomStep;
  if (projection.cols == 4) {
    projection.at<double>(0, 3) *= kZoomStep;  // -f * baseline
  }
}

RemapTable TableOf(const PinholeCamera& camera, const cv::Mat& rotation, const cv::Mat& new_camera) {
  cv::Mat whole, fraction;
  MapPixels(camera, rotation, new_camera, CV_16SC2, whole, fraction);
  return {whole, fraction, camera.width_px, camera.height_px};
}

}  // namespace

Rectifier::Rectifier(const CameraRig& rig, SensorType sensor) {
  calibration_.sensor = sensor;
  calibration_.width_px = rig.left.width_px;
  calibration_.height_px = rig.left.height_px;
  calibration_.fx_px = rig.left.fx_px;
  calibration_.fy_px = rig.left.fy_px;
  calibration_.cx_px = rig.left.cx_px;
  calibration_.cy_px = rig.left.cy_px;
  calibration_.depth_unit_m = sensor == SensorType::kRgbd ? rig.depth_unit_m : 0.0;
  if (sensor == SensorType::kStereo && IsRectifiedPair(rig)) {
    calibration_.baseline_m = -rig.right_from_left.translation.x();
  } else if (sensor == SensorType::kStereo) {
    PreparePair(rig);
  } else if (!rig.left.distortion.empty()) {
    PrepareSingle(rig);
  }
}

Rectifier::~Rectifier() = default;

void Rectifier::PrepareSingle(const CameraRig& rig) {
  const cv::Size size(rig.left.width_px, rig.left.height_px);
  cv::Mat matrix = CameraMatrix(rig.left);
  if (rig.left.lens != LensModel::kEquidistant) {
    matrix = cv::getOptimalNewCameraMatrix(matrix, rig.left.distortion, size, 0.0, size);
  }
  // OpenCV would squeeze the two directions differently; features rely on patches that turn and scale evenly.
  const double scale = std::max(matrix.at<double>(0, 0) / rig.left.fx_px, matrix.at<double>(1, 1) / rig.left.fy_px);
  matrix.at<double>(0, 0) = scale * rig.left.fx_px;
  matrix.at<double>(1, 1) = scale * rig.left.fy_px;
  for (int step = 0; step < kMaxZoomSteps && !SeesOnlyImage(rig.left, cv::Mat(), matrix); ++step) {
    ZoomIn(matrix);
  }
  calibration_.fx_px = matrix.at<double>(0, 0);
  calibration_.fy_px = matrix.at<double>(1, 1);
  calibration_.cx_px = matrix.at<double>(0, 2);
  calibration_.cy_px = matrix.at<double>(1, 2);
  left_ = std::make_unique<RemapTable>(TableOf(rig.left, cv::Mat(), matrix));
}

// P_left = [f 0 cx 0; 0 f cy 0; 0 0 1 0],  P_right = the same with -f * baseline [px m] at the top right.
void Rectifier::PreparePair(const CameraRig& rig) {
  const Eigen::Matrix3d rotation = rig.right_from_left.rotation.toRotationMatrix();
  cv::Mat cv_rotation(3, 3, CV_64F);
  cv::Mat cv_translation(3, 1, CV_64F);
  for (int row = 0; row < 3; ++row) {
    cv_translation.at<double>(row) = rig.right_from_left.translation[row];
    for (int column = 0; column < 3; ++column) {
      cv_rotation.at<double>(row, column) = rotation(row, column);
    }
  }
  const cv::Size size(rig.left.width_px, rig.left.height_px);
  cv::Mat rectified_from_left, rectified_from_right, left_projection, right_projection, unused;
  const bool is_fisheye = rig.left.lens == LensModel::kEquidistant || rig.right->lens == LensModel::kEquidistant;
  const std::vector<double> none;
  cv::stereoRectify(CameraMatrix(rig.left), is_fisheye ? none : rig.left.distortion, CameraMatrix(*rig.right),
                    is_fisheye ? none : rig.right->distortion, size, cv_rotation, cv_translation, rectified_from_left,
                    rectified_from_right, left_projection, right_projection, unused, cv::CALIB_ZERO_DISPARITY,
                    is_fisheye ? kOwnFocal : kNoBorder, size);
  for (int step = 0; step < kMaxZoomSteps && !(SeesOnlyImage(rig.left, rectified_from_left, left_projection) &&
                                               SeesOnlyImage(*rig.right, rectified_from_right, right_projection));
       ++step) {
    ZoomIn(left_projection);
    ZoomIn(right_projection);
  }
  calibration_.fx_px = left_projection.at<double>(0, 0);
  calibration_.fy_px = left_projection.at<double>(1, 1);
  calibration_.cx_px = left_projection.at<double>(0, 2);
  calibration_.cy_px = left_projection.at<double>(1, 2);
  calibration_.baseline_m = -right_projection.at<double>(0, 3) / right_projection.at<double>(0, 0);
  if (!(calibration_.baseline_m > 0.0)) {
    throw InputError(
        "the right camera of the pair stands to the left of the left one, or above or below it: "
        "check the extrinsics in the calibration, or exchange the cameras");
  }
  left_from_rectified_ = Rigid3::FromMatrix(ToEigen(rectified_from_left).transpose(), Eigen::Vector3d::Zero());
  left_ = std::make_unique<RemapTable>(TableOf(rig.left, rectified_from_left, left_projection));
  right_ = std::make_unique<RemapTable>(TableOf(*rig.right, rectified_from_right, right_projection));
}

GrayImage Rectifier::Left(GrayImage image) const { return left_ ? left_->Interpolate(image) : std::move(image); }

ColorImage Rectifier::LeftColor(ColorImage image) const { return left_ ? left_->Interpolate(image) : std::move(image); }

GrayImage Rectifier::Right(GrayImage image) const { return right_ ? right_->Interpolate(image) : std::move(image); }

DepthImage Rectifier::Depth(DepthImage image) const { return left_ ? left_->Nearest(image) : std::move(image); }

}  // namespace tessera
