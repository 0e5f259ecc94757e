// A circuit with known truth for pose graphs: a camera drives once around, its odometry drifts, and the end knows the
// start again.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "geometry/alignment.h"
#include "optimization/pose_graph.h"

namespace tessera {

struct SyntheticCircuitOptions {
  int num_keyframes = 300;
  double step_m = 1.0;                // from keyframe to keyframe
  int num_neighbours = 3;             // keyframes before, that each has an edge to
  bool has_scale = true;              // else the odometry's scale does not drift
  double rotation_sigma_rad = 0.001;  // of odometry, a step
  double translation_sigma = 0.01;    // a step, as a part of it
  double log_scale_sigma = 0.005;     // a step: of the random walk of the scale
  double log_scale_drift = 0.0;       // over the whole circuit
  double unit = 1.0;                  // of the map, per metre
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
  std::vector<double> units;  // of the map around each keyframe, per metre
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
    for (int j = std::max(0, i - options.num_neighbours); j < i; ++j) add_edge(j, i, odometry);
  }
  if (options.has_loop) add_edge(options.num_keyframes - 1, 0, circuit.world_from_keyframe);
  return circuit;
}

// Root mean square distance of the keyframes' centres from the truth after the best similarity, in metres.
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

}  // namespace tessera
