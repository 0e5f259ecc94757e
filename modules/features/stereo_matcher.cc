#include "features/stereo_matcher.h"

#include <algorithm>
#include <cstdlib>

#include "features/simd.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

using simd::AddSaturated;
using simd::SubtractSaturated;
using simd::U16x16;
using simd::U8x32;

constexpr int kRadius = kStereoRadiusPx;
constexpr int kWindow = 2 * kRadius + 1;
constexpr int kPixels = kWindow * kWindow;
constexpr int kMaxDifference = 23;  // 11 of them, one row of the window, fit a byte
static_assert(kMaxDifference * kWindow <= 255);

// A match must cost at most this on average per pixel, ...
constexpr int kMaxMeanCost = 9;
// ... and at most 4/5 of any other position that isn't next to it.
constexpr int kUniqueNumerator = 4;
constexpr int kUniqueDenominator = 5;
constexpr int kNeighborhood = 2;

// Where between the positions -1/2 and 1/2 two lines of equal and opposite slopes through three costs meet, in 1/64;
// before and after >= best. Sums of absolute differences are such lines: a parabola puts the minimum up to a tenth of a
// pixel too near to a whole one (M. Shimizu, M. Okutomi, "Sub-Pixel Estimation Error Cancellation on Area-Based
// Matching", IJCV 2005).
int MeetingOfLines(int before, int best, int after) {
  const int slope = std::max(before, after) - best;
  return slope > 0 ? (before - after) * (StereoMatcher::kSubpixels / 2) / slope : 0;
}

// The position after a Gauss-Newton step on the intensities of the windows, with g the left one's gradient along x:
//
//   minimize sum r^2,  r = right(p + i, .) - left(x + i, .) - their mean:   p' = p - (sum g r) / (sum g^2)
//
// Pixels that differ much are left out, as in the costs. A whole position makes nothing of the pixel to the right of
// the window, which a tile may lack.
int Refined(const LevelImage& left, const LevelImage& right, int x, int y, int right_y, int position) {
  constexpr int kGray = 16;  // intensities are counted in 1/16
  constexpr int kShare = StereoMatcher::kSubpixels / kGray;
  const int column = position / StereoMatcher::kSubpixels, part = position % StereoMatcher::kSubpixels;
  std::array<int, kPixels> residuals;
  int sum = 0;
  for (int j = -kRadius; j <= kRadius; ++j) {
    const uint8_t* left_row = left.At(x - kRadius, y + j);
    const uint8_t* right_row = right.At(column - kRadius, right_y + j);
    int* row = residuals.data() + (j + kRadius) * kWindow;
    for (int i = 0; i < kWindow; ++i) {
      const int blend = (StereoMatcher::kSubpixels - part) * right_row[i] + part * right_row[i + 1];
      row[i] = (blend + kShare / 2) / kShare - kGray * left_row[i];
      sum += row[i];
    }
  }
  const int mean = sum / kPixels;
  int by_residual = 0, by_gradient = 0;
  for (int j = -kRadius; j <= kRadius; ++j) {
    const uint8_t* left_row = left.At(x - kRadius, y + j);
    const int* row = residuals.data() + (j + kRadius) * kWindow;
    for (int i = 0; i < kWindow; ++i) {
      const int residual = row[i] - mean;
      const int twice_gradient = std::abs(residual) > kGray * kMaxDifference ? 0 : left_row[i + 1] - left_row[i - 1];
      by_residual += twice_gradient * residual;
      by_gradient += twice_gradient * twice_gradient;
    }
  }
  if (by_gradient == 0) return position;
  // r in 1/16 and 2 g, in 1/64 px: 64 (sum 2 g r / 32) / (sum (2 g)^2 / 4).
  const int step = -(2 * kShare * by_residual) / by_gradient;
  return position + std::clamp(step, -StereoMatcher::kSubpixels / 2, StereoMatcher::kSubpixels / 2);
}

}  // namespace

void StereoMatcher::ComputeDifferences(const LevelImage& left, const LevelImage& right, int x, int y, int right_y,
                                       int first, int count) {
  int left_sum = 0;
  std::array<uint16_t, kMaxPositions + kWindow> column_sums{};  // of the columns first - kRadius, ...
  const auto num_columns = static_cast<size_t>(count + kWindow - 1);
  for (int j = -kRadius; j <= kRadius; ++j) {
    const uint8_t* left_row = left.At(x - kRadius, y + j);
    const uint8_t* right_row = right.At(first - kRadius, right_y + j);
    for (int i = 0; i < kWindow; ++i) left_sum += left_row[i];
    for (size_t i = 0; i < num_columns; ++i) column_sums[i] = static_cast<uint16_t>(column_sums[i] + right_row[i]);
  }
  int right_sum = 0;
  for (size_t i = 0; i + 1 < kWindow; ++i) right_sum += column_sums[i];
  for (size_t p = 0; p < static_cast<size_t>(count); ++p) {
    right_sum += column_sums[p + kWindow - 1];
    const int difference = left_sum - right_sum;
    const auto mean = static_cast<uint8_t>((std::abs(difference) + kPixels / 2) / kPixels);
    brighter_[p] = difference > 0 ? mean : uint8_t{0};
    darker_[p] = difference < 0 ? mean : uint8_t{0};
    right_sum -= column_sums[p];
  }
}

void StereoMatcher::ComputeCosts(const LevelImage& left, const LevelImage& right, int x, int y, int right_y, int first,
                                 int count) {
  const U8x32 limit = simd::Fill8(kMaxDifference);
  for (int p = 0; p < count; p += 32) {
    const U8x32 brighter = simd::Load8(brighter_.data() + p), darker = simd::Load8(darker_.data() + p);
    U16x16 even = simd::Fill16(0);
    U16x16 odd = simd::Fill16(0);
    for (int j = -kRadius; j <= kRadius; ++j) {
      const uint8_t* left_row = left.At(x - kRadius, y + j);
      const uint8_t* right_row = right.At(first + p - kRadius, right_y + j);
      U8x32 row_cost = simd::Fill8(0);
      for (int i = 0; i < kWindow; ++i) {
        const U8x32 a = simd::Fill8(left_row[i]);
        const U8x32 b = SubtractSaturated(AddSaturated(simd::Load8(right_row + i), brighter), darker);
        const U8x32 difference = simd::Max(SubtractSaturated(a, b), SubtractSaturated(b, a));
        row_cost = simd::Add(row_cost, simd::Min(difference, limit));
      }
      even = simd::Add(even, simd::EvenBytes(row_cost));
      odd = simd::Add(odd, simd::OddBytes(row_cost));
    }
    uint16_t even_costs[16];
    uint16_t odd_costs[16];
    simd::Store(even_costs, even);
    simd::Store(odd_costs, odd);
    for (size_t i = 0; i < 16; ++i) {
      costs_[static_cast<size_t>(p) + 2 * i] = even_costs[i];
      costs_[static_cast<size_t>(p) + 2 * i + 1] = odd_costs[i];
    }
  }
}

std::optional<StereoMatch> StereoMatcher::Match(const LevelImage& left, const LevelImage& right, int x, int y,
                                                int right_y, int max_disparity) {
  // One more position at both ends, so that the first and the last one have neighbors.
  const int first = std::max(x - max_disparity - 1, kRadius);
  const int count = x + 2 - first;
  ComputeDifferences(left, right, x, y, right_y, first, count);
  ComputeCosts(left, right, x, y, right_y, first, count);
  const auto begin = costs_.begin();
  const auto end = begin + count;
  const auto best = std::min_element(begin + 1, end - 1);
  if (*best > kMaxMeanCost * kPixels) return std::nullopt;
  if (best[-1] < *best) return std::nullopt;  // it is nearer than what is searched
  const auto second = [&](auto from, auto to) {
    return from < to ? *std::min_element(from, to) : uint16_t{UINT16_MAX};
  };
  const int other = std::min(second(begin, best - std::min<ptrdiff_t>(best - begin, kNeighborhood)),
                             second(best + std::min<ptrdiff_t>(end - best, kNeighborhood + 1), end));
  if (*best * kUniqueDenominator > other * kUniqueNumerator) return std::nullopt;
  const int at_pixel = (first + static_cast<int>(best - begin)) * kSubpixels;
  const int position = std::min(at_pixel + MeetingOfLines(best[-1], *best, best[1]), x * kSubpixels);
  return StereoMatch{std::min(Refined(left, right, x, y, right_y, position), x * kSubpixels), *best};
}

}  // namespace tessera
