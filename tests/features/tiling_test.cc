#include "features/tiling.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numeric>

#include "core/errors.h"
#include "features/extractor.h"
#include "features/pyramid.h"
#include "features/selection.h"
#include "features/tile_plan.h"
#include "support/feature_images.h"
#include "support/matchers.h"

namespace tessera {
namespace {

TEST(TileGrid, ParsesLinesAndColumns) {
  EXPECT_EQ(ParseTileGrid("2x3"), (TileGrid{2, 3}));
  EXPECT_EQ(ParseTileGrid("64x1"), (TileGrid{64, 1}));
}

TEST(TileGrid, RefusesEverythingElse) {
  for (const char* text : {"0x3", "3x0", "abc", "", "x", "2x", "x2", "65x1", "1x65", "-1x2", "2x3x4", "2x3 ", "2*3",
                           "99999999999x1", "2.5x1"}) {
    EXPECT_THROW(ParseTileGrid(text), InputError) << text;
  }
}

TEST(CutFrame, EveryCellBelongsToOneTile) {
  const GrayImage image = MakeFlat(1241, 376, 0);
  const CameraCalibration calibration = MakeCalibration(SensorType::kMono, image.width, image.height);
  const FeatureOptions options;
  for (const TileGrid grid : {TileGrid{1, 1}, {2, 8}, {3, 5}, {7, 13}, {64, 64}}) {
    const std::vector<TileJob> jobs = CutFrame(MakeFrame(SensorType::kMono, image), calibration, 0, grid, 4, options);
    std::array<int, kMaxLevels> num_cells{};
    for (const TileJob& job : jobs) {
      const TilePlan plan = PlanTile(calibration, options, job.core, job.first_level, job.last_level);
      for (size_t level = 0; level < num_cells.size(); ++level) {
        num_cells[level] += plan.levels[level].cell_columns.size() * plan.levels[level].cell_rows.size();
      }
      EXPECT_EQ(job.num_tiles, static_cast<int>(jobs.size()));
    }
    for (int level = 0; level < options.num_levels; ++level) {
      const CellAxis columns(LevelSize(image.width, level));
      const CellAxis rows(LevelSize(image.height, level));
      EXPECT_EQ(num_cells[static_cast<size_t>(level)], columns.num_cells() * rows.num_cells()) << level;
    }
  }
}

TEST(CutFrame, RefusesImagesOfAnotherSize) {
  CameraFrame frame = MakeFrame(SensorType::kStereo, MakeFlat(100, 80, 0));
  const CameraCalibration calibration = MakeCalibration(SensorType::kStereo, 100, 80);
  EXPECT_NO_THROW(CutFrame(frame, calibration, 0, {}, 4, {}));
  EXPECT_THROW(CutFrame(frame, MakeCalibration(SensorType::kStereo, 101, 80), 0, {}, 4, {}), InputError);
  EXPECT_THROW(CutFrame(frame, calibration, 0, {}, 4, {.num_levels = 0}), InputError);
  frame.right = {};
  EXPECT_THROW(CutFrame(frame, calibration, 0, {}, 4, {}), InputError);
}

TEST(CutFrame, BringsCoarseLevelsReducedAndTheMostWorkFirst) {
  const CameraCalibration calibration = MakeCalibration(SensorType::kMono, 1241, 376);
  const CameraFrame frame = MakeFrame(SensorType::kMono, MakeTexture(1241, 376, 1));
  const std::vector<TileJob> jobs = CutFrame(frame, calibration, 0, {2, 8}, 4, {});
  ASSERT_EQ(jobs.size(), 17U);
  int num_coarse = 0;
  for (size_t i = 0; i < jobs.size(); ++i) {
    EXPECT_EQ(jobs[i].tile, static_cast<int>(i));
    EXPECT_LE(WorkOf(jobs[i]), WorkOf(jobs[i > 0 ? i - 1 : 0])) << "tile " << i;
    if (jobs[i].first_level == 0) continue;
    ++num_coarse;
    EXPECT_EQ(jobs[i].first_level, 4);
    EXPECT_LE(jobs[i].left_rect.right(), LevelSize(1241, 4));
    EXPECT_LE(4 * jobs[i].left.pixels.size(), frame.left.pixels.size());
  }
  EXPECT_EQ(num_coarse, 1);
}

TEST(WorkOf, GrowsWithPixelsAndLevels) {
  TileJob whole;
  whole.last_level = 7;
  whole.left.pixels.resize(36000);
  TileJob stereo = whole;
  stereo.right = whole.left;
  EXPECT_NEAR(static_cast<double>(WorkOf(stereo)), 2.0 * static_cast<double>(WorkOf(whole)), 100.0);
  TileJob fine = whole;
  fine.last_level = 3;
  EXPECT_EQ(WorkOf(fine), 36000 + 25000 + 17361 + 12056);
  TileJob coarse = whole;
  coarse.first_level = 4;
  coarse.left.pixels.resize(12056 * 25 / 36);
  EXPECT_EQ(WorkOf(fine) + WorkOf(coarse), WorkOf(whole));
  EXPECT_GE(WorkOf(TileJob{}), 1);
}

TEST(LevelQuotas, AddUpAndFallByFiveSixths) {
  for (const int num_features : {1, 7, 500, 2000}) {
    const std::array<int, kMaxLevels> quotas = LevelQuotas({.num_features = num_features});
    EXPECT_EQ(std::accumulate(quotas.begin(), quotas.end(), 0), num_features);
    EXPECT_EQ(quotas[8], 0);
  }
  const std::array<int, kMaxLevels> quotas = LevelQuotas({.num_features = 2000});
  for (size_t level = 1; level < 8; ++level) EXPECT_NEAR(quotas[level], quotas[level - 1] * 5.0 / 6.0, 7.0);
}

// A job in the middle of a 3x3 cut of a stereo or RGB-D frame.
TileJob MiddleJob(SensorType sensor) {
  const GrayImage image = MakeTexture(640, 480, 1);
  const CameraCalibration calibration = MakeCalibration(sensor, image.width, image.height);
  return CutFrame(MakeFrame(sensor, image), calibration, 0, {3, 3}, 2, {})[5];
}

void ExpectRefused(const std::vector<std::function<void(TileJob&)>>& harms, SensorType sensor) {
  const TileJob good = MiddleJob(sensor);
  ASSERT_THAT(CheckTileJob(good), IsSuccess());
  for (size_t i = 0; i < harms.size(); ++i) {
    TileJob job = good;
    harms[i](job);
    EXPECT_THAT(CheckTileJob(job), IsFailure(testing::_)) << ToString(sensor) << " harm " << i;
    EXPECT_THROW(Extractor().Extract(job), std::invalid_argument) << ToString(sensor) << " harm " << i;
  }
}

TEST(CheckTileJob, RefusesHostileNumbers) {
  constexpr int kHuge = std::numeric_limits<int>::max();
  constexpr int kLow = std::numeric_limits<int>::min();
  ExpectRefused({[](TileJob& job) { job.frame = FrameId{-1}; },
                 [](TileJob& job) { job.tile = job.num_tiles; },
                 [](TileJob& job) { job.tile = -1; },
                 [](TileJob& job) { job.num_tiles = 0; },
                 [](TileJob& job) { job.calibration.width_px = 0; },
                 [](TileJob& job) { job.calibration.width_px = 1 << 20; },
                 [](TileJob& job) { job.calibration.height_px = kLow; },
                 [](TileJob& job) { job.calibration.fx_px = std::numeric_limits<double>::quiet_NaN(); },
                 [](TileJob& job) { job.calibration.sensor = static_cast<SensorType>(77); },
                 [](TileJob& job) { job.options.num_features = kHuge; },
                 [](TileJob& job) { job.options.num_levels = 99; },
                 [](TileJob& job) { job.options.min_score = 0; },
                 [](TileJob& job) { job.options.max_disparity_px = kHuge; },
                 [](TileJob& job) { job.first_level = -1; },
                 [](TileJob& job) { job.last_level = job.options.num_levels; },
                 [](TileJob& job) { job.first_level = job.last_level + 1; },
                 [](TileJob& job) { job.core.x = -1; },
                 [](TileJob& job) { job.core.width = kHuge; },
                 [](TileJob& job) { job.core.height = -5; },
                 [](TileJob& job) { job.core = {kHuge, kHuge, kHuge, kHuge}; },
                 [](TileJob& job) { job.core = {kLow, kLow, kLow, kLow}; }},
                SensorType::kMono);
}

TEST(CheckTileJob, RefusesMissingPixels) {
  ExpectRefused({[](TileJob& job) { job.left.pixels.pop_back(); }, [](TileJob& job) { job.left.width -= 1; },
                 [](TileJob& job) { job.left = {}; }, [](TileJob& job) { job.left_rect.x -= 1; },
                 [](TileJob& job) { job.left_rect.x += 1; }, [](TileJob& job) { job.left_rect.y = -1; },
                 [](TileJob& job) { job.last_level += 1; }, [](TileJob& job) { job.core = {0, 0, 640, 480}; },
                 [](TileJob& job) {
                   job.left_rect.width -= 1;
                   job.left = GrayImage(job.left_rect.width, job.left_rect.height);
                 }},
                SensorType::kMono);
  ExpectRefused({[](TileJob& job) { job.right = {}; }, [](TileJob& job) { job.right_rect.x += 1; },
                 [](TileJob& job) { job.options.max_disparity_px += 40; }, [](TileJob& job) { job.right_rect = {}; }},
                SensorType::kStereo);
  ExpectRefused({[](TileJob& job) { job.depth = {}; }, [](TileJob& job) { job.depth_rect.y += 1; },
                 [](TileJob& job) { job.depth.pixels.push_back(1); }, [](TileJob& job) { job.depth_rect = {}; }},
                SensorType::kRgbd);
}

TEST(CheckTileFeatures, RefusesHostileValues) {
  const TileFeatures good = Extractor().Extract(MiddleJob(SensorType::kStereo));
  ASSERT_THAT(CheckTileFeatures(good), IsSuccess());
  ASSERT_FALSE(good.candidates.empty());
  const std::vector<std::function<void(TileFeatures&)>> harms = {
      [](TileFeatures& f) { f.frame = FrameId{}; },
      [](TileFeatures& f) { f.tile = f.num_tiles; },
      [](TileFeatures& f) { f.options.num_levels = 1000; },
      [](TileFeatures& f) { f.calibration.height_px = -4; },
      [](TileFeatures& f) { f.descriptors.pop_back(); },
      [](TileFeatures& f) { f.candidates[0].level = 200; },
      [](TileFeatures& f) { f.candidates[0].x = -7; },
      [](TileFeatures& f) { f.candidates[0].x = 640; },
      [](TileFeatures& f) { f.candidates[0].y = 479; },
      [](TileFeatures& f) { f.candidates[0].offset_x = -33; },
      [](TileFeatures& f) { f.candidates[0].offset_y = 127; },
      [](TileFeatures& f) { f.candidates[0].right_x_px = std::numeric_limits<float>::infinity(); },
      [](TileFeatures& f) { f.candidates[0].right_x_px = 640.0F; },
      [](TileFeatures& f) { f.candidates[0].depth_m = std::numeric_limits<float>::quiet_NaN(); },
      [](TileFeatures& f) { f.candidates[0].depth_m = -1.0F; },
  };
  for (size_t i = 0; i < harms.size(); ++i) {
    TileFeatures features = good;
    harms[i](features);
    EXPECT_THAT(CheckTileFeatures(features), IsFailure(testing::_)) << i;
  }
}

}  // namespace
}  // namespace tessera
