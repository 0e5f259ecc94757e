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
  return SelectFeatures(tiles).value().features;
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
  const FeatureFrame expected = SelectFeatures(tiles).value().features;
  tiles.push_back(tiles[1]);
  tiles.push_back(tiles[0]);
  ExpectSame(SelectFeatures(tiles).value().features, expected, "with repeated tiles");
}

// What is left out below any guess either shows as missing, or changes nothing.
TEST(Lossless, CandidatesBelowAGuessAreLeftOutOrMissed) {
  const CameraFrame frame = MakeFrame(SensorType::kStereo, MakeTexture(500, 300, 12));
  const CameraCalibration calibration = MakeCalibration(SensorType::kStereo, 500, 300);
  for (const int num_features : {300, 900, 5000}) {
    const FeatureOptions options{.num_features = num_features};
    const auto extract = [&](const std::vector<int32_t>& min_priority, uint32_t seed) {
      std::mt19937 random(seed);
      Extractor extractor;
      std::vector<TileFeatures> tiles;
      for (TileJob& job : CutFrame(frame, calibration, 99, {2, 3}, 3, options)) {
        if (seed == 0 || random() % 4 > 0) job.min_priority = min_priority;  // some may be asked for all
        tiles.push_back(extractor.Extract(job));
        EXPECT_THAT(CheckTileFeatures(tiles.back()), IsSuccess());
      }
      return tiles;
    };
    const std::vector<TileFeatures> whole = extract({}, 0);
    const Selection expected = SelectFeatures(whole).value();
    int num_selected = 0;
    for (uint32_t tenths = 0; tenths <= 12; ++tenths) {
      std::vector<int32_t> guess = expected.lowest_priority;
      for (int32_t& priority : guess) priority = priority / 10 * static_cast<int32_t>(tenths);
      const std::vector<TileFeatures> tiles = extract(guess, tenths);
      const std::optional<Selection> selection = SelectFeatures(tiles);
      EXPECT_TRUE(selection || tenths > 10) << "nothing that is needed was left out";
      if (!selection) continue;
      ++num_selected;
      ExpectSame(selection->features, expected.features, std::to_string(tenths) + " tenths");
      EXPECT_EQ(selection->lowest_priority, expected.lowest_priority);
    }
    EXPECT_GE(num_selected, 11);
  }
}

TEST(Lossless, AGoodGuessLeavesMostOut) {
  const CameraFrame frame = MakeFrame(SensorType::kMono, MakeTexture(1241, 376, 13));
  const CameraCalibration calibration = MakeCalibration(SensorType::kMono, 1241, 376);
  const FeatureOptions options{.num_features = 1000};
  Extractor extractor;
  std::vector<int32_t> guess;
  for (int turn = 0; turn < 2; ++turn) {
    std::vector<TileFeatures> tiles;
    size_t num_sent = 0;
    for (TileJob& job : CutFrame(frame, calibration, 99, {2, 4}, 4, options)) {
      job.min_priority = guess;
      tiles.push_back(extractor.Extract(job));
      num_sent += tiles.back().candidates.size();
    }
    const std::optional<Selection> selection = SelectFeatures(tiles);
    ASSERT_TRUE(selection);
    guess = selection->lowest_priority;
    if (turn == 0) {
      EXPECT_GT(num_sent, 2000U);
    } else {
      EXPECT_LE(num_sent, 1010U) << "ties of the lowest priority apart, those that are chosen";
    }
  }
}

}  // namespace
}  // namespace tessera
