// Law 1: the features of the tiles joined are the features of the whole image, bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "support/feature_images.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr SensorType kSensors[] = {SensorType::kMono, SensorType::kStereo, SensorType::kRgbd};

void ExpectSame(const FeatureFrame& actual, const FeatureFrame& expected, const std::string& what) {
  EXPECT_EQ(actual.frame, expected.frame) << what;
  EXPECT_EQ(actual.utime_us, expected.utime_us) << what;
  EXPECT_EQ(actual.calibration, expected.calibration) << what;
  EXPECT_TRUE(actual.keypoints == expected.keypoints) << what;
  EXPECT_TRUE(actual.descriptors == expected.descriptors) << what;
}

// Extracts with several extractors, jobs assigned at random and answers arriving in random order.
FeatureFrame ExtractCut(const CameraFrame& frame, TileGrid grid, int coarse_levels_from, const FeatureOptions& options,
                        uint32_t seed) {
  static std::array<Extractor, 3> extractors;
  std::mt19937 random(seed);
  const CameraCalibration calibration = MakeCalibration(frame.sensor, frame.left.width, frame.left.height);
  std::vector<TileFeatures> tiles;
  for (const TileJob& job : CutFrame(frame, calibration, 99, grid, coarse_levels_from, options)) {
    EXPECT_THAT(CheckTileJob(job), IsSuccess());
    tiles.push_back(extractors[random() % extractors.size()].Extract(job));
    EXPECT_THAT(CheckTileFeatures(tiles.back()), IsSuccess());
  }
  std::shuffle(tiles.begin(), tiles.end(), random);
  return SelectFeatures(tiles);
}

void ExpectLossless(const GrayImage& image, SensorType sensor, TileGrid grid, int coarse_levels_from,
                    const FeatureOptions& options, const FeatureFrame& expected, uint32_t seed) {
  const CameraFrame frame = MakeFrame(sensor, image);
  ExpectSame(ExtractCut(frame, grid, coarse_levels_from, options, seed), expected,
             std::to_string(image.width) + "x" + std::to_string(image.height) + " " + ToString(sensor) + " cut " +
                 std::to_string(grid.lines) + "x" + std::to_string(grid.columns) + ", coarse from level " +
                 std::to_string(coarse_levels_from));
}

// Every cut from 1x1 to 2x8 of one sensor; which level the coarse job starts from changes from cut to cut.
void ExpectLosslessForAllCuts(const GrayImage& image, SensorType sensor) {
  const FeatureOptions options;
  const FeatureFrame expected = ExtractWhole(MakeFrame(sensor, image), options);
  for (int lines = 1; lines <= 2; ++lines) {
    for (int columns = 1; columns <= 8; ++columns) {
      const int coarse_levels_from = 2 + (lines + columns) % 4;
      ExpectLossless(image, sensor, {lines, columns}, coarse_levels_from, options, expected,
                     static_cast<uint32_t>(lines * 8 + columns));
    }
  }
}

void ExpectLosslessForRandomCuts(const GrayImage& image, int num_cuts, uint32_t seed) {
  std::mt19937 random(seed);
  const auto between = [&random](int low, int high) {
    return low + static_cast<int>(random() % static_cast<uint32_t>(high - low + 1));
  };
  for (int i = 0; i < num_cuts; ++i) {
    const SensorType sensor = kSensors[random() % 3];
    const FeatureOptions options{.num_features = between(1, 3000),
                                 .num_levels = between(1, 9),
                                 .min_score = between(1, 25),
                                 .max_disparity_px = between(1, 150)};
    const FeatureFrame expected = ExtractWhole(MakeFrame(sensor, image), options);
    const TileGrid grid{between(1, 6), between(1, 10)};
    ExpectLossless(image, sensor, grid, between(0, 9), options, expected, seed + static_cast<uint32_t>(i));
  }
}

TEST(Lossless, KittiImageInAllCuts) {
  const std::optional<GrayImage> image = ReadKittiImage(100);
  if (!image) GTEST_SKIP() << "KITTI sequence 03 is not in " TESSERA_DATA;
  EXPECT_EQ(ExtractWhole(MakeFrame(SensorType::kMono, *image), {}).keypoints.size(), 2000U);
  for (const SensorType sensor : kSensors) ExpectLosslessForAllCuts(*image, sensor);
}

TEST(Lossless, EurocImageInAllCuts) {
  const std::optional<GrayImage> image = ReadRealImage("euroc/MH_01/mav0/cam0/data/1403636584763555584.jpg");
  if (!image) GTEST_SKIP() << "EuRoC MH_01 is not in " TESSERA_DATA;
  EXPECT_EQ(ExtractWhole(MakeFrame(SensorType::kMono, *image), {}).keypoints.size(), 2000U);
  ExpectLosslessForAllCuts(*image, SensorType::kStereo);
}

TEST(Lossless, KitchenImageInAllCuts) {
  const std::optional<GrayImage> image = ReadRealImage("rgbd/kitchen/rgb/0.033333.jpg");
  if (!image) GTEST_SKIP() << "the RGB-D sequence kitchen is not in " TESSERA_DATA;
  ExpectLosslessForAllCuts(*image, SensorType::kRgbd);
}

TEST(Lossless, NoiseInAllCuts) { ExpectLosslessForAllCuts(MakeNoise(640, 480, 1), SensorType::kStereo); }

TEST(Lossless, TextureOfOddSizesInAllCuts) {
  for (const auto& [width, height] : {std::pair{333, 251}, {97, 61}, {61, 297}}) {
    for (const SensorType sensor : kSensors) ExpectLosslessForAllCuts(MakeTexture(width, height, 2), sensor);
  }
}

TEST(Lossless, FlatImageHasNoFeatures) {
  const GrayImage image = MakeFlat(640, 480, 128);
  EXPECT_TRUE(ExtractWhole(MakeFrame(SensorType::kMono, image), {}).keypoints.empty());
  ExpectLosslessForAllCuts(image, SensorType::kStereo);
}

TEST(Lossless, TinyImages) {
  for (const auto& [width, height] : {std::pair{40, 40}, {1, 1}, {7, 300}, {300, 30}, {37, 37}}) {
    ExpectLosslessForRandomCuts(MakeNoise(width, height, 3), 4, 5);
  }
}

TEST(Lossless, RandomCuts) {
  ExpectLosslessForRandomCuts(MakeTexture(1241, 376, 4), 4, 10);
  ExpectLosslessForRandomCuts(MakeNoise(752, 480, 5), 4, 11);
  ExpectLosslessForRandomCuts(MakeTexture(640, 480, 6), 6, 12);
  ExpectLosslessForRandomCuts(MakeTexture(333, 251, 7), 20, 13);
}

// Many equal scores: ties must be broken by place alone.
TEST(Lossless, PeriodicImageWithTies) {
  GrayImage image(400, 300);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) image.row(y)[x] = (x / 9 + y / 7) % 2 != 0 ? 200 : 50;
  }
  ExpectLosslessForRandomCuts(image, 10, 14);
}

TEST(Lossless, SameAnswerAfterJobsOfOtherSizes) {
  const FeatureOptions options;
  const auto job_of = [&options](const GrayImage& image) {
    const CameraCalibration calibration = MakeCalibration(SensorType::kStereo, image.width, image.height);
    return CutFrame(MakeFrame(SensorType::kStereo, image), calibration, 0, {}, 0, options).front();
  };
  const TileJob job = job_of(MakeTexture(333, 251, 8));
  Extractor extractor;
  const TileFeatures first = extractor.Extract(job);
  extractor.Extract(job_of(MakeNoise(640, 480, 9)));
  extractor.Extract(job_of(MakeNoise(97, 61, 10)));
  EXPECT_TRUE(extractor.Extract(job) == first);
  EXPECT_GT(first.candidates.size(), 300U);
}

// Two tiles may send the same candidate; it counts once.
TEST(Lossless, RepeatedCandidatesCountOnce) {
  const GrayImage image = MakeTexture(333, 251, 11);
  const CameraCalibration calibration = MakeCalibration(SensorType::kMono, image.width, image.height);
  const FeatureOptions options{.num_features = 5000};
  Extractor extractor;
  std::vector<TileFeatures> tiles;
  for (const TileJob& job : CutFrame(MakeFrame(SensorType::kMono, image), calibration, 99, {2, 2}, 3, options)) {
    tiles.push_back(extractor.Extract(job));
  }
  const FeatureFrame expected = SelectFeatures(tiles);
  tiles.push_back(tiles[1]);
  tiles.push_back(tiles[0]);
  ExpectSame(SelectFeatures(tiles), expected, "with repeated tiles");
}

}  // namespace
}  // namespace tessera
