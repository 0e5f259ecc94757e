// Time of bundle adjustment on synthetic local windows; time and memory of pose graphs and of global bundle adjustment
// on synthetic streets with one loop, and how they grow.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "optimization/bundle_adjustment.h"
#include "optimization/pose_graph.h"
#include "support/synthetic_problems.h"

namespace tessera {
namespace {

// 20 keyframes of which 4 are fixed, 3000 points, 12000 observations; `percent_right` of them have a right column. All
// of range(1) iterations are made in one round, so that the time an iteration can be told.
void BM_LocalBundle(benchmark::State& state) {
  SyntheticBundleOptions world;
  world.num_poses = static_cast<int>(state.range(2));
  world.num_points = 150 * world.num_poses;
  world.num_fixed = 4;
  world.share_with_right = 0.01 * static_cast<double>(state.range(0));
  world.pixel_noise_px = 0.7;
  const SyntheticBundle bundle = MakeSyntheticBundle(world);
  BundleOptions options;
  options.max_num_iterations = static_cast<int>(state.range(1));
  options.num_rounds = 1;
  options.function_tolerance = 0.0;
  options.max_num_dense_poses = state.range(3) != 0 ? world.num_poses : 0;
  int num_iterations = 0;
  for (auto _ : state) {
    num_iterations = AdjustBundle(bundle.problem, options)->num_iterations;
  }
  state.counters["iterations"] = num_iterations;
}
BENCHMARK(BM_LocalBundle)
    ->ArgNames({"percent_right", "max_iterations", "keyframes", "dense"})
    ->Args({0, 1, 20, 1})
    ->Args({0, 8, 20, 1})
    ->Args({0, 8, 20, 0})
    ->Args({50, 1, 20, 1})
    ->Args({50, 8, 20, 1})
    ->Args({100, 8, 20, 1})
    ->Args({0, 5, 50, 1})
    ->Args({0, 5, 50, 0})
    ->Args({0, 5, 100, 1})
    ->Args({0, 5, 100, 0})
    ->Unit(benchmark::kMillisecond);

// As the mapper runs it: a warm start (2 cm, 4 mrad, 10 cm), the default options.
void BM_LocalBundleWithDefaults(benchmark::State& state) {
  SyntheticBundleOptions world;
  world.num_poses = 20;
  world.num_points = 3000;
  world.num_fixed = 8;
  world.share_with_right = 0.01 * static_cast<double>(state.range(0));
  world.pixel_noise_px = 0.7;
  const SyntheticBundle bundle = MakeSyntheticBundle(world);
  int num_iterations = 0;
  for (auto _ : state) {
    num_iterations = AdjustBundle(bundle.problem, {})->num_iterations;
  }
  state.counters["iterations"] = num_iterations;
}
BENCHMARK(BM_LocalBundleWithDefaults)->ArgNames({"percent_right"})->Arg(0)->Arg(50)->Unit(benchmark::kMillisecond);

double StatusMb(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0.0;
    if (word == field && status >> kilobytes) return kilobytes / 1024.0;
  }
  return 0.0;
}

// The most memory this process held since it was made, over what it held then. Linux.
class PeakMemory {
 public:
  PeakMemory() {
    malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
    before_mb_ = StatusMb("VmRSS:");
  }
  double Mb() const { return StatusMb("VmHWM:") - before_mb_; }

 private:
  double before_mb_ = 0.0;
};

// How a figure grows with the number of keyframes: figure ~ keyframes^exponent, fitted to the logarithms.
class Growth {
 public:
  void Add(const std::string& name, int64_t num_keyframes, double figure) {
    if (figure > 0.0) logs_[name].push_back({std::log(static_cast<double>(num_keyframes)), std::log(figure)});
  }
  void Print() const {
    for (const auto& [name, logs] : logs_) {
      double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
      const auto n = static_cast<double>(logs.size());
      for (const auto& [log_keyframes, log_figure] : logs) {
        x += log_keyframes / n, y += log_figure / n;
        xx += log_keyframes * log_keyframes / n, xy += log_keyframes * log_figure / n;
      }
      if (logs.size() > 1) std::printf("%s ~ keyframes^%.2f\n", name.c_str(), (xy - x * y) / (xx - x * x));
    }
  }

 private:
  std::map<std::string, std::vector<std::pair<double, double>>> logs_;
};

Growth& GrowthOfAll() {
  static Growth growth;
  return growth;
}

// One run of `solve`, in CPU time: others may share the machine.
template <class Solve>
void MeasureRun(benchmark::State& state, const std::string& name, const Solve& solve) {
  for (auto _ : state) {
    const PeakMemory memory;
    const std::clock_t start = std::clock();
    solve();
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    state.SetIterationTime(seconds);
    state.counters["peak_MB"] = memory.Mb();
    GrowthOfAll().Add(name + ": CPU time", state.range(0), seconds);
    GrowthOfAll().Add(name + ": memory", state.range(0), memory.Mb());
  }
}

double CircuitRms(const SyntheticBundle& bundle, const std::vector<Rigid3>& camera_from_world) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (size_t i = 0; i < camera_from_world.size(); ++i) {
    estimated.push_back(camera_from_world[i].Inverse().translation);
    truth.push_back(bundle.camera_from_world[i].Inverse().translation);
  }
  return AlignPoints(estimated, truth, true)->rms;
}

// A circuit of range(0) keyframes, 8 edges a keyframe, one loop; Sim(3) or SE(3).
void BM_PoseGraph(benchmark::State& state) {
  const bool has_scale = state.range(1) != 0;
  const SyntheticCircuit circuit = MakeSyntheticCircuit({.num_keyframes = static_cast<int>(state.range(0)),
                                                         .step_m = 2.0,
                                                         .num_neighbors = 8,
                                                         .has_scale = has_scale,
                                                         .rotation_sigma_rad = 0.0003,
                                                         .log_scale_sigma = 0.002,
                                                         .log_scale_drift = 0.3});
  std::vector<Sim3> poses;
  MeasureRun(state, has_scale ? "pose graph, Sim(3)" : "pose graph, SE(3)",
             [&] { poses = *OptimizePoseGraph(circuit.problem, {}); });
  state.counters["rms_before_m"] = CircuitError(circuit, PosesOf(circuit.problem), 1.0);
  state.counters["rms_after_m"] = CircuitError(circuit, poses, 1.0);
}
BENCHMARK(BM_PoseGraph)
    ->ArgNames({"keyframes", "has_scale"})
    ->ArgsProduct({{100, 300, 1000, 3000}, {1, 0}})
    ->Iterations(1)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

// A whole map of range(0) keyframes after its loop was closed: 60 new landmarks a keyframe, each seen by 3 to 7, so
// that neighbors share about 200; `percent_right` of the observations have a right column.
void BM_GlobalBundle(benchmark::State& state) {
  const SyntheticBundle bundle = MakeSyntheticStreet({.num_keyframes = static_cast<int>(state.range(0)),
                                                      .share_with_right = 0.01 * static_cast<double>(state.range(1))});
  std::vector<Rigid3> start;
  for (const BundlePose& pose : bundle.problem.poses) start.push_back(pose.camera_from_world);
  BundleResult result;
  MeasureRun(state, state.range(1) != 0 ? "global bundle, stereo" : "global bundle, mono",
             [&] { result = *AdjustBundle(bundle.problem, GlobalBundleOptions()); });
  state.counters["iterations"] = result.num_iterations;
  state.counters["observations"] = static_cast<double>(bundle.problem.observations.size());
  state.counters["rms_before_m"] = CircuitRms(bundle, start);
  state.counters["rms_after_m"] = CircuitRms(bundle, result.camera_from_world);
}
BENCHMARK(BM_GlobalBundle)
    ->ArgNames({"keyframes", "percent_right"})
    ->Args({100, 0})
    ->Args({300, 0})
    ->Args({1000, 0})
    ->Args({3000, 0})
    ->Args({100, 70})
    ->Args({300, 70})
    ->Args({1000, 70})
    ->Args({3000, 70})
    ->Iterations(1)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  tessera::GrowthOfAll().Print();
}
