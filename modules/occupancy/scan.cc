#include "occupancy/scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace tessera {
namespace {

constexpr double kMaxCount = std::numeric_limits<uint16_t>::max();
constexpr Rgb kUnknownColor{255, 255, 255};  // OctoMap's of a voxel without one
constexpr double kDisparitySigmaPx = 0.25;

// The number of pixels from one ray to the next.
int StrideFor(const CameraCalibration& camera, const OccupancyOptions& options) {
  const double focal_px = std::min(camera.fx_px, camera.fy_px);
  return std::max(1, static_cast<int>(std::floor(options.resolution * focal_px / options.max_range)));
}

template <class Pixel>
Image<Pixel> Sample(const Image<Pixel>& image, int stride) {
  Image<Pixel> samples((image.width + stride - 1) / stride, (image.height + stride - 1) / stride);
  for (int y = 0; y < samples.height; ++y) {
    const Pixel* from = image.row(y * stride);
    Pixel* to = samples.row(y);
    for (int x = 0; x < samples.width; ++x) to[x] = from[x * stride];
  }
  return samples;
}

cv::Mat View(const GrayImage& image) {
  return {image.height, image.width, CV_8UC1, const_cast<uint8_t*>(image.pixels.data())};
}

// Disparities in 1/16 px; not positive: none. OpenCV leaves out the columns at the left in which the widest disparity
// would begin outside of the right image: both images get a margin there, into which no match may lead.
cv::Mat MatchDisparities(const CameraFrame& frame, int max_disparity_px) {
  constexpr int kWindow = 5;                // px
  constexpr int kArea = kWindow * kWindow;  // the penalties are per pixel of the window
  constexpr int kNumDisparityStep = 16;     // as OpenCV asks
  const int num_disparities = (max_disparity_px + kNumDisparityStep - 1) / kNumDisparityStep * kNumDisparityStep;
  const auto matcher = cv::StereoSGBM::create(0, num_disparities, kWindow, 8 * kArea, 32 * kArea, /*disp12MaxDiff=*/1,
                                              /*preFilterCap=*/31, /*uniquenessRatio=*/10,
                                              /*speckleWindowSize=*/100, /*speckleRange=*/2,
                                              cv::StereoSGBM::MODE_SGBM_3WAY);  // the fastest
  cv::setNumThreads(1);                                                         // parallelism is between processes
  const auto with_margin = [&](const GrayImage& image) {
    cv::Mat wide;
    cv::copyMakeBorder(View(image), wide, 0, 0, num_disparities, 0, cv::BORDER_REPLICATE);
    return wide;
  };
  cv::Mat disparities;
  matcher->compute(with_margin(frame.left), with_margin(frame.right), disparities);
  return disparities.colRange(num_disparities, disparities.cols);
}

DepthImage DepthOfStereo(const CameraFrame& frame, const CameraCalibration& camera, double unit_m,
                         int max_disparity_px) {
  const cv::Mat disparities = MatchDisparities(frame, max_disparity_px);
  DepthImage depth(frame.left.width, frame.left.height);
  for (int y = 0; y < depth.height; ++y) {
    const auto* disparity = disparities.ptr<int16_t>(y);
    uint16_t* counts = depth.row(y);
    for (int x = 0; x < depth.width; ++x) {
      if (disparity[x] <= 0 || disparity[x] > 16 * x) continue;
      const double disparity_px = disparity[x] / 16.0 - RightShiftAt(camera, {x, y});
      if (disparity_px <= 0.0) continue;
      const double depth_m = camera.fx_px * camera.baseline_m / disparity_px;
      counts[x] = static_cast<uint16_t>(std::min(kMaxCount, std::round(depth_m / unit_m)));
    }
  }
  return depth;
}

}  // namespace

Scan ScanFromImages(const CameraFrame& frame, const ColorImage& color, const CameraCalibration& camera,
                    const OccupancyOptions& options, int max_disparity_px) {
  Scan scan{.camera = camera, .stride_px = StrideFor(camera, options)};
  if (camera.sensor == SensorType::kRgbd) {
    scan.depth_unit_m = camera.depth_unit_m;
    scan.depth = Sample(frame.depth, scan.stride_px);
  } else {
    // Whatever is beyond the range is beyond it by any number.
    scan.depth_unit_m = 2.0 * options.max_range / kMaxCount;
    scan.depth = Sample(DepthOfStereo(frame, camera, scan.depth_unit_m, max_disparity_px), scan.stride_px);
  }
  if (color.empty()) {
    scan.intensity = Sample(frame.left, scan.stride_px);
  } else {
    scan.color = Sample(color, scan.stride_px);
  }
  return scan;
}

Scan ScanFromLandmarks(const Map& map, const Keyframe& keyframe, const std::vector<Rgb>& colors) {
  Scan scan{.camera = keyframe.features->calibration};
  const Rigid3 camera_from_world = keyframe.world_from_camera.Inverse();
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const Landmark* const landmark = map.FindLandmark(keyframe.landmarks[i]);
    if (landmark == nullptr) continue;
    scan.landmarks_in_camera.push_back(camera_from_world * landmark->position_in_world);
    if (!colors.empty()) scan.landmark_colors.push_back(colors[i]);
  }
  return scan;
}

double UncertaintyAt(double distance, const CameraCalibration& camera) {
  if (camera.sensor != SensorType::kStereo) return 0.0;
  return 2.0 * kDisparitySigmaPx * distance * distance / (camera.fx_px * camera.baseline_m);
}

std::vector<ScanPoint> PointsOf(const Scan& scan) {
  std::vector<ScanPoint> points;
  for (size_t i = 0; i < scan.landmarks_in_camera.size(); ++i) {
    points.push_back(
        {scan.landmarks_in_camera[i], scan.landmark_colors.empty() ? kUnknownColor : scan.landmark_colors[i]});
  }
  const auto color_at = [&scan](int x, int y) {
    if (!scan.color.empty()) return scan.color.row(y)[x];
    const uint8_t gray = scan.intensity.row(y)[x];
    return Rgb{gray, gray, gray};
  };
  for (int y = 0; y < scan.depth.height; ++y) {
    for (int x = 0; x < scan.depth.width; ++x) {
      const uint16_t count = scan.depth.row(y)[x];
      if (count == 0) continue;
      const Eigen::Vector2d pixel(scan.stride_px * x, scan.stride_px * y);
      points.push_back({scan.depth_unit_m * count * scan.camera.Ray(pixel), color_at(x, y)});
    }
  }
  return points;
}

}  // namespace tessera
