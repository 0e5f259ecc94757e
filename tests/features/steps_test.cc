// Each step against a plain, slow statement of its definition.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "features/corner_detector.h"
#include "features/descriptor.h"
#include "features/pattern.h"
#include "features/pyramid.h"
#include "features/smoother.h"
#include "features/tile_plan.h"
#include "support/feature_images.h"

namespace tessera {
namespace {

Rect WholeOf(const GrayImage& image) { return {.x = 0, .y = 0, .width = image.width, .height = image.height}; }

LevelImage LevelZero(const GrayImage& image) {
  LevelImage level;
  CopyRegion(image, WholeOf(image), WholeOf(image), level);
  return level;
}

// The next level by the definition: position 1.2 x + 0.1 below, bilinear, in exact tenths, rounded to nearest.
GrayImage ReduceSlowly(const GrayImage& below) {
  GrayImage level(5 * below.width / 6, 5 * below.height / 6);
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      const int x10 = 12 * x + 1;
      const int y10 = 12 * y + 1;
      const uint8_t* row = below.row(y10 / 10) + x10 / 10;
      const uint8_t* next = row + below.width;
      const int fx = x10 % 10;
      const int fy = y10 % 10;
      const int sum = (row[0] * (10 - fx) + row[1] * fx) * (10 - fy) + (next[0] * (10 - fx) + next[1] * fx) * fy;
      level.row(y)[x] = static_cast<uint8_t>((sum + 50) / 100);
    }
  }
  return level;
}

// The largest threshold for which the pixel is a FAST-9/16 corner; -1 if there is none.
int ScoreSlowly(const GrayImage& image, int x, int y) {
  constexpr int kRing[16][2] = {{0, 3},  {1, 3},   {2, 2},   {3, 1},   {3, 0},  {3, -1}, {2, -2}, {1, -3},
                                {0, -3}, {-1, -3}, {-2, -2}, {-3, -1}, {-3, 0}, {-3, 1}, {-2, 2}, {-1, 3}};
  const int center = image.row(y)[x];
  const auto is_corner = [&](int threshold) {
    for (int sign : {1, -1}) {
      int run = 0;
      for (int i = 0; i < 16 + 8; ++i) {
        const int value = image.row(y + kRing[i % 16][1])[x + kRing[i % 16][0]];
        run = sign * (value - center) > threshold ? run + 1 : 0;
        if (run == 9) return true;
      }
    }
    return false;
  };
  int score = -1;
  while (score < 255 && is_corner(score + 1)) ++score;
  return score;
}

// Averages of three pixels that are `step` apart, along y, then along x; every average of two is rounded up.
GrayImage SmoothSlowly(const GrayImage& image, int step) {
  const auto smooth3 = [](int before, int center, int after) { return ((before + after + 1) / 2 + center + 1) / 2; };
  GrayImage along_y(image.width, image.height);
  for (int y = step; y < image.height - step; ++y) {
    for (int x = 0; x < image.width; ++x) {
      along_y.row(y)[x] =
          static_cast<uint8_t>(smooth3(image.row(y - step)[x], image.row(y)[x], image.row(y + step)[x]));
    }
  }
  GrayImage smoothed(image.width, image.height);
  for (int y = step; y < image.height - step; ++y) {
    const uint8_t* row = along_y.row(y);
    for (int x = step; x < image.width - step; ++x) {
      smoothed.row(y)[x] = static_cast<uint8_t>(smooth3(row[x - step], row[x], row[x + step]));
    }
  }
  return smoothed;
}

TEST(Pyramid, LevelsAreAsDefined) {
  for (const auto& [width, height] : {std::pair{1241, 376}, {752, 480}, {641, 479}, {97, 61}, {13, 7}}) {
    const GrayImage image = MakeNoise(width, height, 1);
    GrayImage expected = image;
    LevelImage below = LevelZero(image);
    PyramidReducer reducer;
    for (int level = 1; level < 5; ++level) {
      expected = ReduceSlowly(expected);
      ASSERT_EQ(expected.width, LevelSize(width, level));
      ASSERT_EQ(expected.height, LevelSize(height, level));
      LevelImage out;
      out.Reset(WholeOf(expected));
      reducer.Reduce(below, out);
      for (int y = 0; y < expected.height; ++y) {
        ASSERT_TRUE(std::equal(expected.row(y), expected.row(y) + expected.width, out.At(0, y))) << level << " " << y;
      }
      below = out;
    }
  }
}

// Any part of a level, from just the pixels that SourceInterval names, is the same as in the whole.
TEST(Pyramid, PartsHaveThePhaseOfTheWhole) {
  const GrayImage image = MakeNoise(331, 257, 2);
  const GrayImage expected = ReduceSlowly(image);
  std::mt19937 random(3);
  PyramidReducer reducer;
  for (int i = 0; i < 300; ++i) {
    const auto draw = [&random](int size) {
      const int begin = static_cast<int>(random() % static_cast<uint32_t>(size));
      return Interval{begin, begin + 1 + static_cast<int>(random() % static_cast<uint32_t>(size - begin))};
    };
    const Interval x = draw(expected.width);
    const Interval y = draw(expected.height);
    const Interval source_x = SourceInterval(x);
    const Interval source_y = SourceInterval(y);
    ASSERT_LE(source_x.end, image.width);
    ASSERT_LE(source_y.end, image.height);
    LevelImage below;
    CopyRegion(image, WholeOf(image), {source_x.begin, source_y.begin, source_x.size(), source_y.size()}, below);
    LevelImage out;
    out.Reset({x.begin, y.begin, x.size(), y.size()});
    reducer.Reduce(below, out);
    for (int row = y.begin; row < y.end; ++row) {
      ASSERT_TRUE(std::equal(expected.row(row) + x.begin, expected.row(row) + x.end, out.At(x.begin, row)));
    }
  }
}

TEST(Pyramid, PositionsFollowTheScale) {
  EXPECT_FLOAT_EQ(LevelZeroPosition(10.0, 0), 10.0F);
  EXPECT_FLOAT_EQ(LevelZeroPosition(10.0, 1), 12.1F);
  EXPECT_FLOAT_EQ(LevelZeroPosition(0.0, 3), 0.5F * 1.728F - 0.5F);
  for (int level = 0; level < kMaxLevels; ++level) {
    EXPECT_NEAR(LevelScale(level), std::pow(1.2, level), 1e-12);
    for (int half_edges = 0; half_edges < 500; ++half_edges) {
      EXPECT_EQ(LevelZeroEdge(half_edges, level), std::floor(half_edges / 2.0 * LevelScale(level) + 1e-9));
    }
  }
}

TEST(Smoother, AveragesAsDefined) {
  const GrayImage image = MakeNoise(117, 64, 4);
  for (const int step : {1, 2, 3}) {
    const GrayImage expected = SmoothSlowly(image, step);
    const Rect region{.x = 3, .y = 3, .width = 110, .height = 58};
    LevelImage out;
    Smoother().Smooth(LevelZero(image), region, step, out);
    for (int y = region.y; y < region.bottom(); ++y) {
      for (int x = region.x; x < region.right(); ++x) ASSERT_EQ(*out.At(x, y), expected.row(y)[x]) << step;
    }
  }
}

// Corners of the whole level: local maxima with ties to the first in reading order; the best of each cell.
std::vector<Candidate> DetectSlowly(const GrayImage& image, int min_score, int capacity) {
  GrayImage scores(image.width, image.height);
  for (int y = 3; y < image.height - 3; ++y) {
    for (int x = 3; x < image.width - 3; ++x) {
      scores.row(y)[x] = static_cast<uint8_t>(std::max(ScoreSlowly(image, x, y), 0));
    }
  }
  const auto is_maximum = [&scores](int x, int y) {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        const int other = scores.row(y + j)[x + i];
        const bool is_earlier = j < 0 || (j == 0 && i < 0);
        if ((i != 0 || j != 0) && (other > scores.row(y)[x] || (is_earlier && other == scores.row(y)[x]))) return false;
      }
    }
    return true;
  };
  std::vector<Candidate> all;
  for (int cell_y = kBorderPx; cell_y < image.height - kBorderPx; cell_y += kCellPx) {
    for (int cell_x = kBorderPx; cell_x < image.width - kBorderPx; cell_x += kCellPx) {
      std::vector<Candidate> cell;
      for (int y = cell_y; y < std::min(cell_y + kCellPx, image.height - kBorderPx); ++y) {
        for (int x = cell_x; x < std::min(cell_x + kCellPx, image.width - kBorderPx); ++x) {
          if (scores.row(y)[x] < min_score || !is_maximum(x, y)) continue;
          const auto offset = [&](int step_x, int step_y) {
            const int before = std::max<int>(scores.row(y - step_y)[x - step_x], min_score - 1);
            const int after = std::max<int>(scores.row(y + step_y)[x + step_x], min_score - 1);
            const int curvature = 2 * scores.row(y)[x] - before - after;
            if (curvature == 0) return int8_t{0};
            return static_cast<int8_t>(std::lround(kCornerSubpixels * 0.5 * (after - before) / curvature));
          };
          cell.push_back({.x = static_cast<int16_t>(x),
                          .y = static_cast<int16_t>(y),
                          .offset_x = offset(1, 0),
                          .offset_y = offset(0, 1),
                          .score = scores.row(y)[x]});
        }
      }
      std::stable_sort(cell.begin(), cell.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
      cell.resize(std::min(cell.size(), static_cast<size_t>(capacity)));
      all.insert(all.end(), cell.begin(), cell.end());
    }
  }
  return all;
}

TEST(CornerDetector, FindsTheCornersOfTheDefinition) {
  GrayImage coarse = MakeNoise(150, 120, 5);  // few gray values: many ties
  for (uint8_t& pixel : coarse.pixels) pixel = static_cast<uint8_t>(pixel / 64 * 64);
  for (const GrayImage& image : {MakeNoise(155, 131, 5), MakeTexture(203, 97, 6), coarse}) {
    const CameraCalibration calibration = MakeCalibration(SensorType::kMono, image.width, image.height);
    const TilePlan plan = PlanTile(calibration, {.num_levels = 1}, WholeOf(image), 0, 0);
    for (const auto& [min_score, capacity] : {std::pair{7, 4}, {1, 32}, {40, 3}, {254, 4}}) {
      std::vector<Candidate> corners;
      CornerDetector().Detect(LevelZero(image), plan.levels[0], 0, min_score, capacity, corners);
      EXPECT_TRUE(corners == DetectSlowly(image, min_score, capacity)) << image.width << " " << min_score;
      if (min_score < 10) {
        EXPECT_FALSE(corners.empty());
      }
    }
  }
}

TEST(Orientation, AngleIsTheNearestOf256) {
  std::mt19937 random(7);
  for (int i = 0; i < 100000; ++i) {
    const int64_t bound = int64_t{1} << (1 + i % 22);
    const int64_t x = static_cast<int64_t>(random()) % (2 * bound) - bound;
    const int64_t y = static_cast<int64_t>(random()) % (2 * bound) - bound;
    if (x == 0 && y == 0) continue;
    const double turns = std::atan2(static_cast<double>(y), static_cast<double>(x)) / (2.0 * M_PI) * 256.0;
    double difference = std::abs(turns - AngleOf(x, y));
    difference = std::min(difference, 256.0 - difference);
    EXPECT_LE(difference, 0.5001) << x << " " << y;
  }
  EXPECT_EQ(AngleOf(0, 0), 0);
  EXPECT_EQ(AngleOf(5, 0), 0);
  EXPECT_EQ(AngleOf(0, 5), 64);
  EXPECT_EQ(AngleOf(-5, 0), 128);
  EXPECT_EQ(AngleOf(0, -5), 192);
  EXPECT_EQ(AngleOf(5, 5), 32);
}

TEST(Orientation, PointsToTheCentroidOfTheDisc) {
  const GrayImage image = MakeNoise(90, 80, 8);
  const LevelImage level = LevelZero(image);
  for (int y = 15; y < 65; ++y) {
    for (int x = 15; x < 75; ++x) {
      int64_t moment_x = 0;
      int64_t moment_y = 0;
      for (int j = -15; j <= 15; ++j) {
        for (int i = -15; i <= 15; ++i) {
          if (i * i + j * j > 15 * 15 + 15) continue;
          moment_x += i * image.row(y + j)[x + i];
          moment_y += j * image.row(y + j)[x + i];
        }
      }
      ASSERT_EQ(Orientation(level, x, y), AngleOf(moment_x, moment_y));
    }
  }
}

TEST(Descriptor, TestsTheTurnedPattern) {
  const GrayImage image = MakeNoise(60, 50, 9);
  const LevelImage level = LevelZero(image);
  for (int angle = 0; angle < 256; ++angle) {
    const Descriptor descriptor = Describe(level, 30, 25, static_cast<uint8_t>(angle));
    const int turn = (angle + 2) / 4 % 64;
    const double c = std::cos(turn * M_PI / 32.0);
    const double s = std::sin(turn * M_PI / 32.0);
    for (size_t i = 0; i < 256; ++i) {
      const PointPair& pair = UprightPattern()[i];
      const auto value = [&](int x, int y) {
        const double turned_x = c * x - s * y;
        const double turned_y = s * x + c * y;
        // The table has 14 binary places; half a pixel may round either way.
        if (std::abs(std::abs(turned_x - std::floor(turned_x)) - 0.5) < 1e-3) return -1;
        if (std::abs(std::abs(turned_y - std::floor(turned_y)) - 0.5) < 1e-3) return -1;
        return static_cast<int>(image.row(25 + static_cast<int>(std::lround(turned_y)))[30 + std::lround(turned_x)]);
      };
      const int first = value(pair.x1, pair.y1);
      const int second = value(pair.x2, pair.y2);
      if (first < 0 || second < 0) continue;
      EXPECT_EQ((descriptor[i / 64] >> (i % 64) & 1U) != 0, first < second) << angle << " " << i;
    }
  }
}

TEST(Descriptor, PatternStaysWithinThePatchAtEveryAngle) {
  for (const auto& offsets : TurnedPatterns().offsets) {
    for (const uint16_t offset : offsets) {
      EXPECT_LE(offset % kPatternStride, 2 * kPatchRadiusPx);
      EXPECT_LE(offset / kPatternStride, 2 * kPatchRadiusPx);
    }
  }
}

}  // namespace
}  // namespace tessera
