#include "features/corner_detector.h"

#include <algorithm>
#include <bit>

#include "features/simd.h"

namespace tessera {
namespace {

using simd::Max;
using simd::Min;
using simd::SubtractSaturated;
using simd::U8x32;

constexpr int kRowRoom = 32;
constexpr int kLanes = 32;

// Offsets of the ring of 16 pixels at distance 3, in order around it.
struct Ring {
  explicit Ring(ptrdiff_t stride)
      : offsets{3 * stride,  3 * stride + 1,  2 * stride + 2,  stride + 3,
                3,           -stride + 3,     -2 * stride + 2, -3 * stride + 1,
                -3 * stride, -3 * stride - 1, -2 * stride - 2, -stride - 3,
                -3,          stride - 3,      2 * stride - 2,  3 * stride - 1} {}
  ptrdiff_t offsets[16];
};

using Choice = U8x32 (*)(U8x32, U8x32);

// The best of the 16 worst among 9 neighbors each, for the values v[0..15] around the ring: with Min and Max the
// highest brightness that all pixels of an arc have, with Max and Min the lowest. Arcs k .. k + 8 and k + 1 .. k + 9
// share the eight values k + 1 .. k + 8.
template <Choice kWorse, Choice kBetter>
inline U8x32 BestArc(const U8x32* v) {
  U8x32 pairs[8];
  for (int i = 0; i < 8; ++i) pairs[i] = kWorse(v[2 * i + 1], v[(2 * i + 2) & 15]);
  U8x32 quads[8];
  for (int i = 0; i < 8; ++i) quads[i] = kWorse(pairs[i], pairs[(i + 1) & 7]);
  const auto better_of_two = [&](int i) {
    const U8x32 shared = kWorse(quads[i], quads[(i + 2) & 7]);
    return kWorse(shared, kBetter(v[2 * i], v[(2 * i + 9) & 15]));
  };
  U8x32 best = better_of_two(0);
  for (int i = 1; i < 8; ++i) best = kBetter(best, better_of_two(i));
  return best;
}

// A bound of BestArc by the four pixels below, right, above and left: nine neighbors hold two of them in sequence.
template <Choice kWorse, Choice kBetter>
inline U8x32 ArcBound(const U8x32* v) {
  return kWorse(kBetter(v[0], v[8]), kBetter(v[4], v[12]));
}

// By how much the arc is brighter than the center, or darker: what is greater.
inline U8x32 Contrast(U8x32 brightest, U8x32 darkest, U8x32 center) {
  return Max(SubtractSaturated(brightest, center), SubtractSaturated(center, darkest));
}

// Scores of the 32 pixels from `p` on; 0 where lower than min_score (which may be left out as well where no pixel of
// the 32 reaches it).
inline U8x32 Scores(const uint8_t* p, const Ring& ring, U8x32 below_min_score) {
  const U8x32 center = simd::Load8(p);
  U8x32 values[16];
  for (const int i : {0, 4, 8, 12}) values[i] = simd::Load8(p + ring.offsets[i]);
  const U8x32 bound = Contrast(ArcBound<Min, Max>(values), ArcBound<Max, Min>(values), center);
  const U8x32 one = simd::Fill8(1);
  if (simd::AllZero(SubtractSaturated(SubtractSaturated(bound, one), below_min_score))) return simd::Fill8(0);
  for (const int i : {1, 2, 3, 5, 6, 7, 9, 10, 11, 13, 14, 15}) values[i] = simd::Load8(p + ring.offsets[i]);
  return SubtractSaturated(Contrast(BestArc<Min, Max>(values), BestArc<Max, Min>(values), center), one);
}

// Where between the positions -1 and 1 a parabola through three scores has its maximum, in 1/kCornerSubpixels, rounded
// to nearest: (after - before) / (2 (2 best - before - after)); before and after <= best.
inline int8_t ParabolaMaximum(int before, int best, int after) {
  const int curvature = 2 * best - before - after;
  if (curvature == 0) return 0;
  const int slope = (after - before) * (kCornerSubpixels / 2);
  return static_cast<int8_t>((slope + (slope < 0 ? -curvature : curvature) / 2) / curvature);
}

}  // namespace

void CornerDetector::ScoreRow(const LevelImage& image, const Rect& corners, int y, int min_score) {
  const Ring ring(image.stride());
  const U8x32 below_min_score = simd::Fill8(static_cast<uint8_t>(min_score - 1));
  uint8_t* out = ScoreRowAt(y) + kRowRoom - 1;
  const uint8_t* in = image.At(corners.x - 1, y);
  for (int x = 0; x < corners.width + 2; x += kLanes) simd::Store(out + x, Scores(in + x, ring, below_min_score));
}

CornerDetector::Corner CornerDetector::CornerAt(const Rect& corners, int x, int y) {
  const int column = kRowRoom + x - corners.x;
  const uint8_t* row = ScoreRowAt(y) + column;
  return {.x = static_cast<int16_t>(x),
          .y = static_cast<int16_t>(y),
          .score = row[0],
          .left = row[-1],
          .right = row[1],
          .above = ScoreRowAt(y - 1)[column],
          .below = ScoreRowAt(y + 1)[column]};
}

void CornerDetector::Insert(size_t cell, Corner corner) {
  Corner* const begin = &best_[cell * static_cast<size_t>(capacity_)];
  int& count = num_best_[cell];
  Corner* slot = begin + std::min(count, capacity_ - 1);
  for (; slot > begin && slot[-1].score < corner.score; --slot) *slot = slot[-1];
  *slot = corner;
  count = std::min(count + 1, capacity_);
  if (count == capacity_) lowest_[cell] = begin[capacity_ - 1].score;
}

void CornerDetector::KeepMaxima(const Rect& corners, int y, int min_score) {
  static_assert(kCellPx == kLanes, "one vector is one row of a cell");
  const U8x32 below_min_score = simd::Fill8(static_cast<uint8_t>(min_score - 1));
  const uint8_t* above = ScoreRowAt(y - 1) + kRowRoom;
  const uint8_t* row = ScoreRowAt(y) + kRowRoom;
  const uint8_t* below = ScoreRowAt(y + 1) + kRowRoom;
  size_t cell = 0;
  for (int x = 0; x < corners.width; x += kLanes, ++cell) {
    const U8x32 score = simd::Load8(row + x);
    if (simd::AllZero(SubtractSaturated(score, below_min_score))) continue;
    const U8x32 before = Max(Max(simd::Load8(above + x - 1), simd::Load8(above + x)),
                             Max(simd::Load8(above + x + 1), simd::Load8(row + x - 1)));
    const U8x32 after = Max(Max(simd::Load8(below + x - 1), simd::Load8(below + x)),
                            Max(simd::Load8(below + x + 1), simd::Load8(row + x + 1)));
    const U8x32 bar = Max(Max(before, SubtractSaturated(after, simd::Fill8(1))), simd::Fill8(lowest_[cell]));
    uint32_t maxima = simd::GreaterMask(score, bar);
    const int num_columns = std::min(corners.width - x, kLanes);
    if (num_columns < kLanes) maxima &= (1U << num_columns) - 1U;
    for (; maxima != 0; maxima &= maxima - 1) {
      const int column = x + std::countr_zero(maxima);
      if (row[column] > lowest_[cell]) {
        Insert(cell, CornerAt(corners, corners.x + column, y));
      }
    }
  }
}

void CornerDetector::Detect(const LevelImage& image, const LevelPlan& plan, int level, int min_score, int capacity,
                            std::vector<Candidate>& out) {
  const Rect& corners = plan.corners;
  if (corners.empty()) return;
  const auto num_columns = static_cast<size_t>(plan.cell_columns.size());
  capacity_ = capacity;
  best_.resize(std::max(best_.size(), num_columns * static_cast<size_t>(capacity)));
  num_best_.assign(num_columns, 0);
  lowest_.assign(num_columns, static_cast<uint8_t>(min_score - 1));
  for (auto& row : score_rows_) row.resize(std::max(row.size(), static_cast<size_t>(corners.width) + 3 * kRowRoom));

  // Lower scores may or may not have been computed, which depends on the cut.
  const auto at_least = [min_score](uint8_t score) { return std::max<int>(score, min_score - 1); };
  ScoreRow(image, corners, corners.y - 1, min_score);
  ScoreRow(image, corners, corners.y, min_score);
  for (int y = corners.y; y < corners.bottom(); ++y) {
    ScoreRow(image, corners, y + 1, min_score);
    KeepMaxima(corners, y, min_score);
    const bool is_last_row_of_cells = (y + 1 - kBorderPx) % kCellPx == 0 || y + 1 == corners.bottom();
    if (!is_last_row_of_cells) continue;
    for (size_t cell = 0; cell < num_columns; ++cell) {
      for (int i = 0; i < num_best_[cell]; ++i) {
        const Corner& corner = best_[cell * static_cast<size_t>(capacity_) + static_cast<size_t>(i)];
        out.push_back({.x = corner.x,
                       .y = corner.y,
                       .offset_x = ParabolaMaximum(at_least(corner.left), corner.score, at_least(corner.right)),
                       .offset_y = ParabolaMaximum(at_least(corner.above), corner.score, at_least(corner.below)),
                       .level = static_cast<uint8_t>(level),
                       .score = corner.score});
      }
      num_best_[cell] = 0;
      lowest_[cell] = static_cast<uint8_t>(min_score - 1);
    }
  }
}

}  // namespace tessera
