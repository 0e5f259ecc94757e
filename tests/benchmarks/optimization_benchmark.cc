// Time of bundle adjustment on synthetic local windows.
#include <benchmark/benchmark.h>

#include "optimization/bundle_adjustment.h"
#include "optimization/synthetic_bundle.h"

namespace tessera {
namespace {

// 20 keyframes of which 4 are fixed, 3000 points, 12000 observations; `percent_right` of them have a right column. All of
// range(1) iterations are made in one round, so that the time an iteration can be told.
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

}  // namespace
}  // namespace tessera
