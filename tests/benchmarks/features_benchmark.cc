// Time of extraction and selection on one thread, against cv::ORB with the same number of keypoints. Every iteration
// takes the next of several images spread over KITTI sequence 03, or of as many made ones where that is absent.
#include <benchmark/benchmark.h>

#include <opencv2/features2d.hpp>

#include "features/extractor.h"
#include "features/selection.h"
#include "features/tile_packing.h"
#include "features/tiling.h"
#include "support/feature_images.h"
#include "support/warped_pairs.h"

namespace tessera {
namespace {

constexpr int kNumImages = 16;

// Frames 0, 50, 100, ... of the sequence.
const std::vector<GrayImage>& Images() {
  static const std::vector<GrayImage> images = [] {
    std::vector<GrayImage> result;
    for (int i = 0; i < kNumImages; ++i) {
      const std::optional<GrayImage> image = ReadKittiImage(50 * i);
      result.push_back(image ? *image : MakeTexture(1241, 376, static_cast<uint32_t>(i)));
    }
    return result;
  }();
  return images;
}

// The jobs of each image under this cut.
std::vector<std::vector<TileJob>> Cut(SensorType sensor, TileGrid grid, int coarse_levels_from) {
  std::vector<std::vector<TileJob>> jobs;
  for (const GrayImage& image : Images()) {
    const CameraCalibration calibration = MakeCalibration(sensor, image.width, image.height);
    jobs.push_back(CutFrame(MakeFrame(sensor, image), calibration, 0, grid, coarse_levels_from, FeatureOptions{}));
  }
  return jobs;
}

// Mean share of keypoints that are found again within 2 px, over the motions of a few of the images.
template <class Extract>
double MeanRepeatability(Extract extract) {
  constexpr size_t kStep = 4;  // a quarter of the images is enough
  double sum = 0.0;
  int num_pairs = 0;
  for (size_t i = 0; i < kNumImages; i += kStep) {
    for (const WarpedPair& pair : MakeWarpedPairs(Images()[i])) {
      sum += Repeatability(pair, extract(pair.first, FeatureOptions{}), extract(pair.second, FeatureOptions{}));
      ++num_pairs;
    }
  }
  return sum / num_pairs;
}

void CvOrb(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(FeatureOptions{}.num_features);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  size_t i = 0;
  for (auto _ : state) {
    const GrayImage& image = Images()[i++ % kNumImages];
    const cv::Mat mat(image.height, image.width, CV_8U, const_cast<uint8_t*>(image.pixels.data()));
    orb->detectAndCompute(mat, cv::noArray(), keypoints, descriptors);
    benchmark::DoNotOptimize(descriptors.data);
  }
  state.counters["keypoints"] = static_cast<double>(keypoints.size());
  static const double repeatability = MeanRepeatability(ExtractCvOrb);
  state.counters["repeatability"] = repeatability;
}

size_t NumBytes(const std::vector<TileJob>& jobs) {
  size_t bytes = 0;
  for (const TileJob& job : jobs) {
    bytes += job.left.pixels.size() + job.right.pixels.size() + 2 * job.depth.pixels.size() + job.packed.pixels.size();
  }
  return bytes;
}

// Extraction of all jobs of an image by one extractor, and selection.
void Extraction(benchmark::State& state, SensorType sensor, TileGrid grid, int coarse_levels_from) {
  const std::vector<std::vector<TileJob>> jobs = Cut(sensor, grid, coarse_levels_from);
  Extractor extractor;
  FeatureFrame frame;
  size_t num_candidates = 0;
  size_t i = 0;
  for (auto _ : state) {
    std::vector<TileFeatures> tiles;
    num_candidates = 0;
    for (const TileJob& job : jobs[i++ % kNumImages]) {
      tiles.push_back(extractor.Extract(job));
      num_candidates += tiles.back().candidates.size();
    }
    frame = SelectFeatures(tiles).value().features;
    benchmark::DoNotOptimize(frame.keypoints.data());
  }
  state.counters["keypoints"] = static_cast<double>(frame.keypoints.size());
  state.counters["candidates"] = static_cast<double>(num_candidates);
  state.counters["wire_kB"] = static_cast<double>(NumBytes(jobs.front())) / 1000.0;
  if (sensor != SensorType::kMono) return;
  // Of the whole image: that the cut changes nothing is what the tests of losslessness show.
  static const double repeatability = MeanRepeatability(ExtractTessera);
  state.counters["repeatability"] = repeatability;
}

// What the dispatcher does.
void Cutting(benchmark::State& state, TileGrid grid, int coarse_levels_from) {
  const GrayImage& image = Images().front();
  const CameraFrame frame = MakeFrame(SensorType::kMono, image);
  const CameraCalibration calibration = MakeCalibration(SensorType::kMono, image.width, image.height);
  for (auto _ : state) {
    benchmark::DoNotOptimize(CutFrame(frame, calibration, 0, grid, coarse_levels_from, FeatureOptions{}).data());
  }
}

// All jobs of an image, for links to other machines.
std::vector<TileJob> Packed(const std::vector<TileJob>& jobs) {
  std::vector<TileJob> packed;
  for (const TileJob& job : jobs) packed.push_back(PackTile(job));
  return packed;
}

// What the dispatcher does to them.
void Packing(benchmark::State& state, TileGrid grid) {
  const std::vector<std::vector<TileJob>> jobs = Cut(SensorType::kMono, grid, 4);
  size_t i = 0;
  double num_bytes = 0.0, num_packed = 0.0;
  for (auto _ : state) {
    const std::vector<TileJob>& image = jobs[i++ % kNumImages];
    const std::vector<TileJob> packed = Packed(image);
    num_bytes += static_cast<double>(NumBytes(image));
    num_packed += static_cast<double>(NumBytes(packed));
  }
  state.counters["share"] = num_packed / num_bytes;
}

// And the extractors.
void Unpacking(benchmark::State& state, TileGrid grid) {
  std::vector<std::vector<TileJob>> jobs = Cut(SensorType::kMono, grid, 4);
  for (std::vector<TileJob>& image : jobs) image = Packed(image);
  size_t i = 0;
  for (auto _ : state) {
    for (TileJob job : jobs[i++ % kNumImages]) benchmark::DoNotOptimize(UnpackTile(job).has_value());
  }
}

BENCHMARK(CvOrb)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, whole, SensorType::kMono, TileGrid{1, 1}, 0)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x2, SensorType::kMono, TileGrid{2, 2}, 4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x8, SensorType::kMono, TileGrid{2, 8}, 4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x8_coarse_from_2, SensorType::kMono, TileGrid{2, 8}, 2)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x8_coarse_from_3, SensorType::kMono, TileGrid{2, 8}, 3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x8_coarse_from_8, SensorType::kMono, TileGrid{2, 8}, 8)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, whole_stereo, SensorType::kStereo, TileGrid{1, 1}, 0)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Extraction, cut_2x8_stereo, SensorType::kStereo, TileGrid{2, 8}, 4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Cutting, cut_2x8, TileGrid{2, 8}, 4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Packing, whole, TileGrid{1, 1})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Packing, cut_2x8, TileGrid{2, 8})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Unpacking, whole, TileGrid{1, 1})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(Unpacking, cut_2x8, TileGrid{2, 8})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tessera
