// The image pyramid, defined on the coordinates of the whole image, so that any part of a level can be computed from
// the part of the image below it with the same bits as from all of it.
//
// A pixel x of level l + 1 is sampled at   1.2 (x + 1/2) - 1/2 = 1.2 x + 0.1   of level l. Five pixels cover six, so
// the bilinear weights are exact tenths that repeat: (9,1) (7,3) (5,5) (3,7) (1,9); both directions together give
// hundredths, rounded once. A keypoint x of level l stands at   1.2^l (x + 1/2) - 1/2   of the image.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/image.h"

namespace tessera {

// Powers, by level.
inline constexpr std::array<int64_t, 13> kPowersOf5 = {1,     5,      25,      125,     625,      3125,     15625,
                                                       78125, 390625, 1953125, 9765625, 48828125, 244140625};
inline constexpr std::array<int64_t, 13> kPowersOf6 = {1,      6,       36,       216,      1296,      7776,      46656,
                                                       279936, 1679616, 10077696, 60466176, 362797056, 2176782336};
inline constexpr std::array<double, 13> kLevelScales = [] {
  std::array<double, 13> scales{};
  for (size_t l = 0; l < scales.size(); ++l) {
    scales[l] = static_cast<double>(kPowersOf6[l]) / static_cast<double>(kPowersOf5[l]);
  }
  return scales;
}();

// Pixels begin .. end - 1 along one axis.
struct Interval {
  int begin = 0;
  int end = 0;

  int size() const { return end - begin; }
  bool empty() const { return end <= begin; }
  bool operator==(const Interval&) const = default;
};

// The smallest interval that holds both; an empty one adds nothing.
Interval Hull(Interval a, Interval b);

// Width or height of a level of an image whose width or height is `size`.
int LevelSize(int size, int level);

// 1.2^level
inline double LevelScale(int level) { return kLevelScales[static_cast<size_t>(level)]; }

// Level-0 position of position `x` (of a pixel's center, in pixels) of a level.
float LevelZeroPosition(double x, int level);

// floor of the level-0 coordinate of the edge `half_edges` / 2 of a level, where edge x is the left side of pixel x.
int LevelZeroEdge(int half_edges, int level);

// The pixels of the level below from which those of `level_interval` are sampled.
Interval SourceInterval(Interval level_interval);

// Part of one level of the pyramid. Rows have room on both sides, so that vector loops may read and write beyond the
// region; what stands there is arbitrary and must not reach a result.
class LevelImage {
 public:
  // Room at the left of a row, and behind its end, px.
  static constexpr int kLeftRoom = 64;
  static constexpr int kRightRoom = 160;

  // Makes this the part `region` of a level, in the level's coordinates. The pixels are arbitrary. Allocates only where
  // more bytes are needed than ever before.
  void Reset(const Rect& region);

  const Rect& region() const { return region_; }
  int stride() const { return stride_; }
  // The pixel (x, y) of the level.
  uint8_t* At(int x, int y) { return bytes_.data() + Offset(x, y); }
  const uint8_t* At(int x, int y) const { return bytes_.data() + Offset(x, y); }

 private:
  ptrdiff_t Offset(int x, int y) const {
    return static_cast<ptrdiff_t>(y - region_.y) * stride_ + (x - region_.x) + kLeftRoom;
  }

  Rect region_;
  int stride_ = 0;
  std::vector<uint8_t> bytes_;
};

// Copies `region` of a level from `pixels`, which is the part `rect` of the level and holds the region.
void CopyRegion(const GrayImage& pixels, const Rect& rect, const Rect& region, LevelImage& out);

// Computes the pixels of out.region() from the level below, which must hold their SourceIntervals.
class PyramidReducer {
 public:
  void Reduce(const LevelImage& below, LevelImage& out);

 private:
  const uint16_t* HorizontalRow(const LevelImage& below, int y);

  int first_x_ = 0;  // of the output, a multiple of 5
  int num_chunks_ = 0;
  int rows_y_[2] = {0, 0};         // the rows of the level below ...
  std::vector<uint16_t> rows_[2];  // ... that are held here, reduced horizontally, in tenths
};

// The whole of a level, of the whole image.
GrayImage ReduceToLevel(const GrayImage& image, int level);

}  // namespace tessera
