// A world with known truth for bundle adjustment: a camera that drives forward and turns, past points on both sides.
#pragma once

#include <random>
#include <vector>

#include "optimization/bundle_adjustment.h"

namespace tessera {

struct SyntheticBundleOptions {
  int num_poses = 8;
  int num_points = 200;
  int track_length = 4;         // consecutive poses that see a point
  int num_fixed = 2;            // the first poses
  double share_with_right = 0;  // of observations: 0 mono, 1 stereo or RGB-D
  double pixel_noise_px = 0.0;  // standard deviation
  double pose_error = 0.02;     // of the start, uniform: m, and rad / 5
  double point_error_m = 0.1;
};

struct SyntheticBundle {
  BundleProblem problem;  // starts away from the truth
  std::vector<Rigid3> camera_from_world;
  std::vector<Eigen::Vector3d> positions_in_world;
};

inline Eigen::Vector3d UniformVector(std::mt19937_64& generator, double scale) {
  std::uniform_real_distribution<double> uniform(-scale, scale);
  const double x = uniform(generator), y = uniform(generator), z = uniform(generator);
  return {x, y, z};
}

// (v, w), uniform in each coordinate.
inline Eigen::Matrix<double, 6, 1> UniformTangent(std::mt19937_64& generator, double scale_m, double scale_rad) {
  Eigen::Matrix<double, 6, 1> tangent;
  tangent.head<3>() = UniformVector(generator, scale_m);
  tangent.tail<3>() = UniformVector(generator, scale_rad);
  return tangent;
}

inline CameraCalibration SyntheticCamera() {
  CameraCalibration calibration;
  calibration.width_px = 1240;
  calibration.height_px = 376;
  calibration.fx_px = 718.0;
  calibration.fy_px = 715.0;
  calibration.cx_px = 607.0;
  calibration.cy_px = 185.0;
  return calibration;
}

// Exact observation; the right column is left out where `has_right` is false.
inline PixelObservation Observe(const BundleProblem& problem, const Eigen::Vector3d& point_in_camera, bool has_right) {
  PixelObservation seen;
  seen.pixel_px = problem.calibration.Project(point_in_camera);
  if (has_right) {
    seen.right_x_px = seen.pixel_px.x() - problem.calibration.fx_px * problem.baseline_m / point_in_camera.z();
  }
  return seen;
}

inline SyntheticBundle MakeSyntheticBundle(const SyntheticBundleOptions& options) {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> normal;
  SyntheticBundle bundle;
  BundleProblem& problem = bundle.problem;
  problem.calibration = SyntheticCamera();
  problem.baseline_m = 0.54;
  for (int i = 0; i < options.num_poses; ++i) {
    const Rigid3 world_from_camera{ExpSO3({0.0, 0.02 * i, 0.0}), {0.005 * i * i, 0.01 * i, 0.8 * i}};
    bundle.camera_from_world.push_back(world_from_camera.Inverse());
    const auto error = UniformTangent(generator, options.pose_error, 0.2 * options.pose_error);
    const bool is_fixed = i < options.num_fixed;
    const Rigid3 start = is_fixed ? world_from_camera.Inverse() : Retract(world_from_camera.Inverse(), error);
    problem.poses.push_back({KeyframeId{i}, start, is_fixed});
  }
  for (int i = 0; i < options.num_points; ++i) {
    const int first = i % (options.num_poses - options.track_length + 1);
    const double z = 6.0 + 20.0 * unit(generator);
    const Eigen::Vector3d ray = UniformVector(generator, 1.0).cwiseProduct(Eigen::Vector3d(0.6, 0.2, 0.0));
    const Eigen::Vector3d in_first = z * (ray + Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d position = bundle.camera_from_world[static_cast<size_t>(first)].Inverse() * in_first;
    bundle.positions_in_world.push_back(position);
    problem.points.push_back({LandmarkId{i}, position + UniformVector(generator, options.point_error_m)});
    for (int pose = first; pose < first + options.track_length; ++pose) {
      const Eigen::Vector3d in_camera = bundle.camera_from_world[static_cast<size_t>(pose)] * position;
      PixelObservation seen = Observe(problem, in_camera, unit(generator) < options.share_with_right);
      const double u = normal(generator), v = normal(generator), right = normal(generator);
      seen.pixel_px += options.pixel_noise_px * Eigen::Vector2d(u, v);
      seen.right_x_px += seen.has_right() ? options.pixel_noise_px * right : 0.0;
      problem.observations.push_back({pose, i, seen});
    }
  }
  return bundle;
}

}  // namespace tessera
