// A street with known truth for global bundle adjustment: a circuit whose loop a pose graph has closed, with landmarks
// on both sides.
#pragma once

#include <algorithm>

#include "optimization/bundle_adjustment.h"
#include "support/synthetic_bundle.h"
#include "support/synthetic_circuit.h"

namespace tessera {

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
