#include "datasets/published_calibration.h"

#include <array>
#include <filesystem>

namespace tessera {
namespace {

namespace fs = std::filesystem;

// J. Sturm, N. Engelhard, F. Endres, W. Burgard, D. Cremers, "A Benchmark for the Evaluation of RGB-D SLAM Systems",
// IROS 2012, and its page: the color cameras as calibrated with the ROS tools. The images of freiburg3 are undistorted
// already. Depth images are corrected already by the factors that the page lists.
struct TumCamera {
  const char* name;
  double fx_px, fy_px, cx_px, cy_px;
  std::vector<double> distortion;
};

const std::array<TumCamera, 3>& TumCameras() {
  static const std::array<TumCamera, 3> kCameras = {
      {{"freiburg1", 517.3, 516.5, 318.6, 255.3, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
       {"freiburg2", 520.9, 521.0, 325.1, 249.7, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172}},
       {"freiburg3", 535.4, 539.2, 320.1, 247.6, {}}}};
  return kCameras;
}

constexpr int kTumWidthPx = 640;
constexpr int kTumHeightPx = 480;
constexpr double kTumCountsPerMeter = 5000.0;

// The last name of the path as it was given, and of what it is a link to.
std::array<std::string, 2> NamesOf(const std::string& folder) {
  std::error_code error;
  const fs::path given = (fs::absolute(folder, error) / "").lexically_normal().parent_path();
  return {given.filename().string(), fs::canonical(folder, error).filename().string()};
}

}  // namespace

std::optional<PublishedCalibration> PublishedTumCalibration(const std::string& folder) {
  for (const std::string& name : NamesOf(folder)) {
    for (const TumCamera& camera : TumCameras()) {
      if (!name.starts_with(std::string("rgbd_dataset_") + camera.name + "_")) continue;
      PublishedCalibration published{camera.name, {}};
      published.rig.left = {kTumWidthPx,  kTumHeightPx, camera.fx_px,     camera.fy_px,
                            camera.cx_px, camera.cy_px, camera.distortion};
      published.rig.depth_unit_m = 1.0 / kTumCountsPerMeter;
      return published;
    }
  }
  return std::nullopt;
}

}  // namespace tessera
