#include "support/feature_images.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"

namespace tessera {
namespace {

GrayImage FromMat(const cv::Mat& mat) {
  GrayImage image(mat.cols, mat.rows);
  for (int y = 0; y < mat.rows; ++y) std::copy_n(mat.ptr<uint8_t>(y), mat.cols, image.row(y));
  return image;
}

}  // namespace

std::optional<GrayImage> ReadRealImage(const std::string& path) {
  const cv::Mat mat = cv::imread(std::string(TESSERA_DATA) + "/" + path, cv::IMREAD_GRAYSCALE);
  if (mat.empty()) return std::nullopt;
  return FromMat(mat);
}

std::optional<GrayImage> ReadKittiImage(int frame) {
  std::string name = std::to_string(frame);
  name.insert(0, 6 - name.size(), '0');
  return ReadRealImage("kitti/sequences/03/image_0/" + name + ".jpg");
}

GrayImage MakeNoise(int width, int height, uint32_t seed) {
  std::mt19937 random(seed);
  GrayImage image(width, height);
  for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>(random() >> 24);
  return image;
}

GrayImage MakeFlat(int width, int height, uint8_t value) { return {width, height, value}; }

GrayImage MakeTexture(int width, int height, uint32_t seed) {
  std::mt19937 random(seed);
  const auto below = [&random](int bound) { return static_cast<int>(random() % static_cast<uint32_t>(bound)); };
  cv::Mat mat(height, width, CV_8U, cv::Scalar(128));
  const int num_shapes = width * height / 120;
  for (int i = 0; i < num_shapes; ++i) {
    const int size = 4 + below(8) * below(8);
    const cv::Point center(below(width), below(height));
    const cv::Scalar gray(20 + below(216));
    if (below(3) == 0) {
      cv::circle(mat, center, size / 2, gray, cv::FILLED);
    } else {
      const auto angle = static_cast<float>(below(360));
      const cv::RotatedRect box(center, cv::Size2f(static_cast<float>(size), static_cast<float>(3 + below(size))),
                                angle);
      cv::Point2f corners[4];
      box.points(corners);
      cv::Point polygon[4];
      for (int k = 0; k < 4; ++k) polygon[k] = corners[k];
      cv::fillConvexPoly(mat, polygon, 4, gray);
    }
  }
  cv::GaussianBlur(mat, mat, cv::Size(5, 5), 0.8);
  GrayImage image = FromMat(mat);
  for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>(pixel + below(7) - 3);
  return image;
}

double DisparityOfRow(int y, int height, double far_px, double near_px) {
  return far_px + (near_px - far_px) * y / (height - 1);
}

GrayImage MakeRightView(const GrayImage& left, double far_px, double near_px) {
  cv::Mat columns(left.height, left.width, CV_32F);
  cv::Mat rows(left.height, left.width, CV_32F);
  for (int y = 0; y < left.height; ++y) {
    for (int x = 0; x < left.width; ++x) {
      columns.at<float>(y, x) = static_cast<float>(x + DisparityOfRow(y, left.height, far_px, near_px));
      rows.at<float>(y, x) = static_cast<float>(y);
    }
  }
  const cv::Mat mat(left.height, left.width, CV_8U, const_cast<uint8_t*>(left.pixels.data()));
  cv::Mat right;
  cv::remap(mat, right, columns, rows, cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return FromMat(right);
}

DepthImage MakeDepth(int width, int height) {
  DepthImage depth(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) depth.row(y)[x] = static_cast<uint16_t>((x * 7919 + y * 104729) % 10000);
  }
  return depth;
}

CameraCalibration MakeCalibration(SensorType sensor, int width, int height) {
  return {.sensor = sensor,
          .width_px = width,
          .height_px = height,
          .fx_px = 500.0,
          .fy_px = 500.0,
          .cx_px = width / 2.0,
          .cy_px = height / 2.0,
          .baseline_m = sensor == SensorType::kStereo ? 0.1 : 0.0,
          .depth_unit_m = sensor == SensorType::kRgbd ? 0.001 : 0.0};
}

CameraFrame MakeFrame(SensorType sensor, const GrayImage& left) {
  CameraFrame frame{.id = FrameId{7}, .utime_us = 123456, .sensor = sensor, .left = left, .right = {}, .depth = {}};
  if (sensor == SensorType::kStereo) frame.right = MakeRightView(left, 3.0, 40.0);
  if (sensor == SensorType::kRgbd) frame.depth = MakeDepth(left.width, left.height);
  return frame;
}

FeatureFrame ExtractWhole(const CameraFrame& frame, const FeatureOptions& options) {
  const CameraCalibration calibration = MakeCalibration(frame.sensor, frame.left.width, frame.left.height);
  Extractor extractor;
  std::vector<TileFeatures> tiles;
  for (const TileJob& job : CutFrame(frame, calibration, 99, TileGrid{}, 0, options))
    tiles.push_back(extractor.Extract(job));
  return SelectFeatures(tiles).value().features;
}

}  // namespace tessera
