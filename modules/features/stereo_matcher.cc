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

// Where between the positions -1 and 1 a parabola through three costs has its minimum, in 1/64; before and after >=
// best.
int ParabolaMinimum(int before, int best, int after) {
  const int curvature = before - 2 * best + after;
  if (curvature == 0) return 0;
  return (before - after) * (StereoMatcher::kSubpixels / 2) / curvature;
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
  const auto second = [&](auto from, auto to) {
    return from < to ? *std::min_element(from, to) : uint16_t{UINT16_MAX};
  };
  const int other = std::min(second(begin, best - std::min<ptrdiff_t>(best - begin, kNeighborhood)),
                             second(best + std::min<ptrdiff_t>(end - best, kNeighborhood + 1), end));
  if (*best * kUniqueDenominator > other * kUniqueNumerator) return std::nullopt;
  const int position = (first + static_cast<int>(best - begin)) * kSubpixels;
  return StereoMatch{std::min(position + ParabolaMinimum(best[-1], *best, best[1]), x * kSubpixels), *best};
}

}  // namespace tessera
