// A straight road, what stands beside it, and what a camera on a car sees of them.
#pragma once

#include <memory>
#include <random>
#include <vector>

#include "features/pyramid.h"
#include "measurement/frame_view.h"
#include "support/planted_descriptors.h"
#include "support/synthetic_views.h"

namespace tessera {

// The world: x right, y down, z along the road, whose surface is y = 0. Meters.
class SyntheticRoad {
 public:
  static constexpr double kHeight_m = 1.5;  // of the camera

  // `num_on_road` points of the road in its 300 m, and a third as many that stand beside it. `row_m`: the road looks
  // the same again after so much of it; 0: nowhere.
  explicit SyntheticRoad(int num_on_road, double row_m = 0.0) {
    std::uniform_real_distribution<double> aside(-5.0, 5.0), along(0.0, 300.0), up(0.5, 6.0);
    const int num_rows = row_m > 0.0 ? static_cast<int>(300.0 / row_m) : 1;
    for (int i = 0; i < num_on_road / num_rows; ++i) {
      const Descriptor look = RandomDescriptor(generator_);
      const double x = aside(generator_), z = along(generator_) / num_rows;
      for (int row = 0; row < num_rows; ++row) points_.push_back({{x, 0.0, z + row * row_m}, look});
    }
    for (int i = 0; i < num_on_road / 3; ++i) {
      const double x = (i % 2 == 0 ? 8.0 : -8.0) + aside(generator_) / 5.0;
      points_.push_back({{x, -up(generator_), along(generator_)}, RandomDescriptor(generator_)});
    }
  }

  // A camera `height_m` above the road after `way_m` along it, which looks down by `pitch_rad`.
  static Rigid3 Pose(double way_m, double pitch_rad, double height_m = kHeight_m) {
    return {ExpSO3({-pitch_rad, 0.0, 0.0}), {0.0, -height_m, way_m}};
  }

  std::shared_ptr<const FrameView> Take(const Rigid3& world_from_camera) {
    FeatureFrame frame;
    frame.calibration = MakeCamera();
    std::normal_distribution<double> noise_px(0.0, 0.4);
    const Rigid3 camera_from_world = world_from_camera.Inverse();
    for (const auto& [point, look] : points_) {
      const Eigen::Vector3d in_camera = camera_from_world * point;
      if (in_camera.z() < 2.0 || in_camera.z() > 60.0) continue;
      const Eigen::Vector2d pixel = frame.calibration.Project(in_camera);
      if (pixel.x() < 0.0 || pixel.x() >= frame.calibration.width_px || pixel.y() < 0.0 ||
          pixel.y() >= frame.calibration.height_px) {
        continue;
      }
      Keypoint keypoint;
      keypoint.level = static_cast<uint8_t>(LevelOf(in_camera.z()));
      const double scale = LevelScale(keypoint.level);
      keypoint.x_px = static_cast<float>(pixel.x() + scale * noise_px(generator_));
      keypoint.y_px = static_cast<float>(pixel.y() + scale * noise_px(generator_));
      frame.keypoints.push_back(keypoint);
      frame.descriptors.push_back(Perturb(look, 20, generator_));
    }
    return std::make_shared<const FrameView>(std::move(frame));
  }

 private:
  struct Point {
    Eigen::Vector3d position;
    Descriptor look;
  };

  // What is near looks large: level 7 at 5 m, 0 from 18 m on.
  static int LevelOf(double depth_m) {
    int level = 0;
    while (level < 7 && depth_m * LevelScale(level + 1) < 18.0) ++level;
    return level;
  }

  std::mt19937_64 generator_{1};
  std::vector<Point> points_;
};

}  // namespace tessera
