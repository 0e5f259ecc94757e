// What the solvers are given, with known truth: a bundle adjustment, a pose graph, and the global bundle adjustment
// that follows it.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "geometry/alignment.h"
#include "optimization/bundle_adjustment.h"
#include "optimization/pose_graph.h"

namespace tessera {

// A bundle: a camera that drives forward and turns, past points on both sides.
struct SyntheticBundleOptions {
  int num_poses = 8;
  int num_points = 200;
  int track_length = 4;         // consecutive poses that see a point
  int num_fixed = 2;            // the first poses
  double share_with_right = 0;  // of observations: 0 mono, 1 stereo or RGB-D
  double pixel_noise_px = 0.0;  // standard deviation
  double pose_error = 0.02;     // of the start, uniform: m, and rad / 5
  double point_error_m = 0.1;
  double inverse_depth_error = 0.0;  // of the start, uniform: a share of the inverse depth
  double min_depth_m = 6.0;          // of points in the first camera that sees them
  double depth_range_m = 20.0;
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
    const double z = options.min_depth_m + options.depth_range_m * unit(generator);
    const Eigen::Vector3d ray = UniformVector(generator, 1.0).cwiseProduct(Eigen::Vector3d(0.6, 0.2, 0.0));
    const Eigen::Vector3d in_first = z * (ray + Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d position = bundle.camera_from_world[static_cast<size_t>(first)].Inverse() * in_first;
    bundle.positions_in_world.push_back(position);
    Eigen::Vector3d start = position + UniformVector(generator, options.point_error_m);
    if (options.inverse_depth_error > 0.0) {
      const Eigen::Vector3d center = bundle.camera_from_world[static_cast<size_t>(first)].Inverse().translation;
      start = center + (start - center) / (1.0 + options.inverse_depth_error * (2.0 * unit(generator) - 1.0));
    }
    problem.points.push_back({LandmarkId{i}, start});
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

// A circuit: a camera drives once around, its odometry drifts, and the end knows the start again.
struct SyntheticCircuitOptions {
  int num_keyframes = 300;
  double step_m = 1.0;                // from keyframe to keyframe
  int num_neighbors = 3;              // keyframes before, that each has an edge to
  bool has_scale = true;              // else the odometry's scale does not drift
  double rotation_sigma_rad = 0.001;  // of odometry, a step
  double translation_sigma = 0.01;    // a step, as a part of it
  double log_scale_sigma = 0.005;     // a step: of the random walk of the scale
  double log_scale_drift = 0.0;       // over the whole circuit
  double unit = 1.0;                  // of the map, per meter
  bool has_loop = true;
  uint64_t seed = 1;
};

struct SyntheticCircuit {
  PoseGraphProblem problem;               // starts as odometry left it, all scales 1, the first node fixed
  std::vector<Sim3> world_from_keyframe;  // the truth, in the first keyframe's unit
};

inline Rigid3 CircuitPose(const SyntheticCircuitOptions& options, int i) {
  const auto center = [&](double angle) -> Eigen::Vector3d {
    const double radius = options.step_m * options.num_keyframes / (2.0 * std::numbers::pi);
    const double r = radius * (1.0 + 0.3 * std::cos(3.0 * angle) + 0.1 * std::sin(2.0 * angle));
    return {r * std::sin(angle), -0.02 * radius * std::cos(2.0 * angle), -r * std::cos(angle)};
  };
  const double per_step = 2.0 * std::numbers::pi / options.num_keyframes;
  const Eigen::Vector3d forward = (center(per_step * (i + 0.5)) - center(per_step * (i - 0.5))).normalized();
  Eigen::Matrix3d world_from_camera;
  world_from_camera.col(2) = forward;
  world_from_camera.col(0) = Eigen::Vector3d::UnitY().cross(forward).normalized();
  world_from_camera.col(1) = forward.cross(world_from_camera.col(0));
  return Rigid3::FromMatrix(world_from_camera, center(per_step * i));
}

inline Sim3 WithScale(const Rigid3& pose, double scale) { return {scale, pose.rotation, pose.translation}; }

inline SyntheticCircuit MakeSyntheticCircuit(const SyntheticCircuitOptions& options) {
  std::mt19937_64 generator(options.seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) -> Eigen::Vector3d {
    const double x = normal(generator), y = normal(generator), z = normal(generator);
    return sigma * Eigen::Vector3d(x, y, z);
  };
  SyntheticCircuit circuit;
  std::vector<PoseGraphNode>& nodes = circuit.problem.nodes;
  circuit.problem.has_scale = options.has_scale;
  std::vector<double> units;  // of the map around each keyframe, per meter
  const Rigid3 first = CircuitPose(options, 0);
  for (int i = 0; i < options.num_keyframes; ++i) {
    const Rigid3 true_pose = first.Inverse() * CircuitPose(options, i);
    if (i == 0) {
      units.push_back(options.unit);
      nodes.push_back({KeyframeId{0}, {}, true});
    } else {
      const double walk = options.log_scale_sigma * normal(generator) + options.log_scale_drift / options.num_keyframes;
      units.push_back(units.back() * (options.has_scale ? std::exp(walk) : 1.0));
      const Rigid3 step = CircuitPose(options, i - 1).Inverse() * CircuitPose(options, i);
      const Rigid3 measured{step.rotation * ExpSO3(noise(options.rotation_sigma_rad)),
                            units.back() * (step.translation + noise(options.translation_sigma * options.step_m))};
      nodes.push_back({KeyframeId{i}, nodes.back().world_from_keyframe * WithScale(measured, 1.0), false});
    }
    circuit.world_from_keyframe.push_back(
        {options.unit / units.back(), true_pose.rotation, options.unit * true_pose.translation});
  }
  const auto add_edge = [&](int from, int to, const std::vector<Sim3>& poses) {
    const Sim3 to_from_from = poses[static_cast<size_t>(to)].Inverse() * poses[static_cast<size_t>(from)];
    const double depth = 10.0 * units[static_cast<size_t>(from)];
    circuit.problem.edges.push_back({from, to, to_from_from, 1.0, depth});
  };
  std::vector<Sim3> odometry;
  for (const PoseGraphNode& node : nodes) odometry.push_back(node.world_from_keyframe);
  for (int i = 0; i < options.num_keyframes; ++i) {
    for (int j = std::max(0, i - options.num_neighbors); j < i; ++j) add_edge(j, i, odometry);
  }
  if (options.has_loop) add_edge(options.num_keyframes - 1, 0, circuit.world_from_keyframe);
  return circuit;
}

// Root mean square distance of the keyframes' centers from the truth after the best similarity, in meters.
inline double CircuitError(const SyntheticCircuit& circuit, const std::vector<Sim3>& world_from_keyframe, double unit) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (size_t i = 0; i < world_from_keyframe.size(); ++i) {
    estimated.push_back(world_from_keyframe[i].translation / unit);
    truth.push_back(circuit.world_from_keyframe[i].translation / unit);
  }
  return AlignPoints(estimated, truth, circuit.problem.has_scale)->rms;
}

inline std::vector<Sim3> PosesOf(const PoseGraphProblem& problem) {
  std::vector<Sim3> poses;
  for (const PoseGraphNode& node : problem.nodes) poses.push_back(node.world_from_keyframe);
  return poses;
}

// A street: a circuit whose loop a pose graph has closed, with landmarks on both sides.
struct SyntheticStreetOptions {
  int num_keyframes = 100;
  int num_new_landmarks = 60;     // by keyframe
  int max_track_length = 7;       // a landmark is seen by 3 .. max_track_length keyframes in a row, around the circuit
  double share_with_right = 0.0;  // of observations
  double pixel_noise_px = 0.7;
  double outlier_share = 0.01;  // of observations: wrong by up to 40 px
  double depth_noise = 0.05;    // of landmarks at the start
};

// Starts where the pose graph ended; mono keeps the first pose and the distance to the one half way around.
inline SyntheticBundle MakeSyntheticStreet(const SyntheticStreetOptions& options) {
  const bool has_scale = options.share_with_right == 0.0;
  const SyntheticCircuitOptions circuit_options{.num_keyframes = options.num_keyframes,
                                                .step_m = 2.0,
                                                .has_scale = has_scale,
                                                .rotation_sigma_rad = 0.0003,
                                                .log_scale_sigma = 0.002,
                                                .log_scale_drift = 0.3};
  const SyntheticCircuit circuit = MakeSyntheticCircuit(circuit_options);
  const std::vector<Sim3> start = *OptimizePoseGraph(circuit.problem, {});
  const std::vector<Sim3>& truth = circuit.world_from_keyframe;

  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> normal;
  SyntheticBundle bundle;
  BundleProblem& problem = bundle.problem;
  problem.calibration = SyntheticCamera();
  problem.baseline_m = 0.54;
  for (size_t i = 0; i < truth.size(); ++i) {
    bundle.camera_from_world.push_back(Rigid3{truth[i].rotation, truth[i].translation}.Inverse());
    const Rigid3 camera_from_world = Rigid3{start[i].rotation, start[i].translation}.Inverse();
    problem.poses.push_back({KeyframeId{static_cast<int64_t>(i)}, camera_from_world, i == 0});
  }
  problem.scale_pose = has_scale ? options.num_keyframes / 2 : -1;
  const auto observe = [&](int pose, const Eigen::Vector3d& in_camera) {
    PixelObservation seen = Observe(problem, in_camera, unit(generator) < options.share_with_right);
    const double u = normal(generator), v = normal(generator), right = normal(generator);
    seen.pixel_px += options.pixel_noise_px * Eigen::Vector2d(u, v);
    seen.right_x_px += seen.has_right() ? options.pixel_noise_px * right : 0.0;
    if (unit(generator) < options.outlier_share) seen.pixel_px += UniformVector(generator, 40.0).head<2>();
    problem.observations.push_back({pose, static_cast<int>(problem.points.size()), seen});
  };
  for (int i = 0; i < options.num_keyframes; ++i) {
    for (int k = 0; k < options.num_new_landmarks; ++k) {
      const double z = 14.0 + 30.0 * unit(generator), side = unit(generator) < 0.5 ? -1.0 : 1.0;
      const Eigen::Vector3d in_first{side * (3.0 + 0.5 * z * unit(generator)), 0.25 * z * (unit(generator) - 0.7), z};
      const double in_map_unit = (1.0 + options.depth_noise * normal(generator)) / truth[static_cast<size_t>(i)].scale;
      const Eigen::Vector3d position = bundle.camera_from_world[static_cast<size_t>(i)].Inverse() * in_first;
      const int length = 3 + static_cast<int>(unit(generator) * (options.max_track_length - 2));
      for (int step = 0; step < std::min(length, options.num_keyframes); ++step) {
        const int pose = (i + step) % options.num_keyframes;
        const Eigen::Vector3d in_camera = bundle.camera_from_world[static_cast<size_t>(pose)] * position;
        if (in_camera.z() > 1.0) observe(pose, in_camera);
      }
      bundle.positions_in_world.push_back(position);
      problem.points.push_back({LandmarkId{static_cast<int64_t>(problem.points.size())},
                                start[static_cast<size_t>(i)] * (in_map_unit * in_first)});
    }
  }
  return bundle;
}

}  // namespace tessera
