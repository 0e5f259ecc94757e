// A world with known truth for mapping: a camera that drives forward past points on both sides, and the features that
// it would extract.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "features/feature_types.h"
#include "geometry/rigid3.h"
#include "measurement/landmark_view.h"

namespace tessera {

class SyntheticWorld {
 public:
  explicit SyntheticWorld(SensorType sensor, double noise_px, size_t num_points = 1500) : noise_px_(noise_px) {
    calibration_.sensor = sensor;
    calibration_.width_px = 960;
    calibration_.height_px = 480;
    calibration_.fx_px = calibration_.fy_px = 500.0;
    calibration_.cx_px = 480.0;
    calibration_.cy_px = 240.0;
    calibration_.baseline_m = sensor == SensorType::kStereo ? 0.5 : 0.0;
    for (size_t i = 0; i < num_points; ++i) {
      std::uniform_real_distribution<double> side(3.0, 9.0), height(-4.0, 2.0), ahead(0.0, 45.0);
      const double sign = i % 2 == 0 ? 1.0 : -1.0, x = side(generator_), y = height(generator_);
      points_.push_back({sign * x, y, ahead(generator_)});
      descriptors_.push_back({generator_(), generator_(), generator_(), generator_()});
    }
  }

  const CameraCalibration& calibration() const { return calibration_; }
  const Eigen::Vector3d& point(size_t i) const { return points_[i]; }

  // True world_from_camera at a step: half a metre forward each, on a slight bend.
  Rigid3 Pose(double step) const {
    return {ExpSO3({0.0, 0.01 * step, 0.0}), {0.02 * step, 0.01 * std::sin(step), 0.5 * step}};
  }

  struct Picture {
    FeatureFrame features;
    std::vector<size_t> points;  // by keypoint: the point that it shows
  };

  // What the camera extracts at a step; keypoints in the order of points. A point's patch covers 0.1 m.
  Picture Take(int64_t step) {
    Picture picture;
    picture.features.frame = {step};
    picture.features.utime_us = 100000 * step;
    picture.features.calibration = calibration_;
    const Rigid3 camera_from_world = Pose(static_cast<double>(step)).Inverse();
    std::normal_distribution<double> noise(0.0, noise_px_);
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d point = camera_from_world * points_[i];
      if (point.z() < 1.0 || point.z() > 20.0) continue;
      const double size = std::log(25.0 / point.norm()) / std::log(1.2);
      Keypoint keypoint;
      keypoint.level = static_cast<uint8_t>(std::clamp(std::lround(size), 0L, 7L));
      const double sigma = noise_px_ > 0.0 ? LevelScale(keypoint.level) : 0.0;
      Eigen::Vector2d pixel = calibration_.Project(point);
      pixel += sigma * Eigen::Vector2d(noise(generator_), noise(generator_));
      if (pixel.x() < 0.0 || pixel.x() >= 960.0 || pixel.y() < 0.0 || pixel.y() >= 480.0) continue;
      keypoint.x_px = static_cast<float>(pixel.x());
      keypoint.y_px = static_cast<float>(pixel.y());
      if (calibration_.sensor == SensorType::kStereo) {
        const double disparity = calibration_.fx_px * calibration_.baseline_m / point.z();
        keypoint.right_x_px = static_cast<float>(pixel.x() - disparity + sigma * noise(generator_));
      }
      picture.features.keypoints.push_back(keypoint);
      Descriptor descriptor = descriptors_[i];
      for (int flips = 0; flips < 10; ++flips) descriptor[generator_() % 4] ^= uint64_t{1} << (generator_() % 64);
      picture.features.descriptors.push_back(descriptor);
      picture.points.push_back(i);
    }
    return picture;
  }

 private:
  CameraCalibration calibration_;
  double noise_px_;
  std::mt19937_64 generator_{7};
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
};

}  // namespace tessera
