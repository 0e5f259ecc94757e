#include "features/descriptor.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "features/pattern.h"
#include "features/simd.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

using simd::Average;
using simd::Load8;
using simd::U16x16;
using simd::U8x32;

constexpr int kRadius = kPatchRadiusPx;

// One row of the disc: 255 where the pixel belongs to it. Byte i stands for x = i - 15.
using DiscRow = std::array<uint8_t, 32>;

constexpr std::array<DiscRow, kRadius + 1> MakeDisc() {
  std::array<DiscRow, kRadius + 1> disc{};
  for (int y = 0; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      // r^2 + r rounds the circle's edge to the nearest pixel.
      const bool is_inside = x * x + y * y <= kRadius * kRadius + kRadius;
      disc[static_cast<size_t>(y)][static_cast<size_t>(x + kRadius)] = is_inside ? 255 : 0;
    }
  }
  return disc;
}

constexpr std::array<DiscRow, kRadius + 1> kDisc = MakeDisc();

// x of the even and odd bytes of a row, as signed 16-bit numbers.
constexpr std::array<uint16_t, 16> MakeColumns(int first) {
  std::array<uint16_t, 16> columns{};
  for (int i = 0; i < 16; ++i) columns[static_cast<size_t>(i)] = static_cast<uint16_t>(2 * i + first - kRadius);
  return columns;
}

constexpr std::array<uint16_t, 16> kEvenColumns = MakeColumns(0);
constexpr std::array<uint16_t, 16> kOddColumns = MakeColumns(1);

// round(2^16 tan((k + 1/2) / 256 turn)), k = 0 .. 31: the bounds between neighbouring angles of the first octant.
constexpr std::array<int64_t, 32> kTangents = {
    804,   2414,  4026,  5644,  7268,  8901,  10545, 12202, 13874, 15564, 17273, 19005, 20762, 22546, 24360, 26208,
    28093, 30018, 31986, 34002, 36071, 38196, 40382, 42636, 44963, 47369, 49863, 52451, 55144, 57950, 60880, 63947};

// Taps (1 2 1) / 4 with centre b.
inline U8x32 Smooth3(U8x32 a, U8x32 b, U8x32 c) { return Average(Average(a, c), b); }

}  // namespace

uint8_t AngleOf(int64_t x, int64_t y) {
  const int64_t larger = std::max(std::abs(x), std::abs(y));
  const int64_t smaller = std::min(std::abs(x), std::abs(y));
  if (larger == 0) return 0;
  const auto bound = std::partition_point(kTangents.begin(), kTangents.end(), [&](int64_t tangent) {
    return tangent * larger <= smaller << 16;
  });
  auto angle = static_cast<int>(bound - kTangents.begin());
  if (std::abs(y) > std::abs(x)) angle = 64 - angle;
  if (x < 0) angle = 128 - angle;
  if (y < 0) angle = 256 - angle;
  return static_cast<uint8_t>(angle & 255);
}

uint8_t Orientation(const LevelImage& image, int x, int y) {
  // Column sums over all rows give the x moment; differences of the rows y and -y, times y, the y moment. Even and odd
  // columns are kept apart in 16-bit lanes; the largest value is 255 * (1 + .. + 15) = 30600.
  const uint8_t* centre = image.At(x - kRadius, y);
  const ptrdiff_t stride = image.stride();
  const U8x32 middle = simd::And(Load8(centre), Load8(kDisc[0].data()));
  U16x16 even_sums = simd::EvenBytes(middle);
  U16x16 odd_sums = simd::OddBytes(middle);
  U16x16 y_moments = simd::Fill16(0);
  U16x16 odd_y_moments = y_moments;
  for (int dy = 1; dy <= kRadius; ++dy) {
    const U8x32 disc = Load8(kDisc[static_cast<size_t>(dy)].data());
    const U8x32 below = simd::And(Load8(centre + dy * stride), disc);
    const U8x32 above = simd::And(Load8(centre - dy * stride), disc);
    const U16x16 even_below = simd::EvenBytes(below);
    const U16x16 even_above = simd::EvenBytes(above);
    const U16x16 odd_below = simd::OddBytes(below);
    const U16x16 odd_above = simd::OddBytes(above);
    const U16x16 factor = simd::Fill16(static_cast<uint16_t>(dy));
    even_sums = simd::Add(even_sums, simd::Add(even_below, even_above));
    odd_sums = simd::Add(odd_sums, simd::Add(odd_below, odd_above));
    y_moments = simd::Add(y_moments, simd::MultiplyLow(simd::Subtract(even_below, even_above), factor));
    odd_y_moments = simd::Add(odd_y_moments, simd::MultiplyLow(simd::Subtract(odd_below, odd_above), factor));
  }
  const U16x16 ones = simd::Fill16(1);
  const int32_t x_moment = simd::SignedDot(even_sums, simd::Load16(kEvenColumns.data())) +
                           simd::SignedDot(odd_sums, simd::Load16(kOddColumns.data()));
  const int32_t y_moment = simd::SignedDot(y_moments, ones) + simd::SignedDot(odd_y_moments, ones);
  return AngleOf(x_moment, y_moment);
}

void Smoother::SmoothNear(const LevelImage& image, const Rect& region, int y) {
  uint8_t* out = NearRow(y);
  const uint8_t* in = image.At(region.x - kBlurRadiusPx, y);
  const ptrdiff_t stride = image.stride();
  for (int x = 0; x < region.width + 2 * kBlurRadiusPx; x += 32) {
    simd::Store(out + x, Smooth3(Load8(in + x - stride), Load8(in + x), Load8(in + x + stride)));
  }
}

void Smoother::Smooth(const LevelImage& image, const Rect& region, LevelImage& out) {
  out.Reset(region);
  const size_t row_size = static_cast<size_t>(region.width) + 2 * kBlurRadiusPx + 64;
  for (auto& row : near_rows_) row.resize(std::max(row.size(), row_size));
  row_.resize(std::max(row_.size(), row_size));
  for (int y = region.y - 2; y < region.y + 2; ++y) SmoothNear(image, region, y);
  for (int y = region.y; y < region.bottom(); ++y) {
    SmoothNear(image, region, y + 2);
    for (int x = 0; x < region.width + 2 * kBlurRadiusPx; x += 32) {
      simd::Store(row_.data() + x,
                  Smooth3(Load8(NearRow(y - 2) + x), Load8(NearRow(y) + x), Load8(NearRow(y + 2) + x)));
    }
    uint8_t* out_row = out.At(region.x, y);
    for (int x = 0; x < region.width; x += 32) {
      const auto near = [row = row_.data() + x](int i) { return Smooth3(Load8(row + i), Load8(row + i + 1), Load8(row + i + 2)); };
      simd::Store(out_row + x, Smooth3(near(0), near(2), near(4)));
    }
  }
}

Descriptor Describe(const LevelImage& smoothed, int x, int y, uint8_t angle) {
  // A copy of the patch with a fixed stride makes the turned offsets constants.
  std::array<uint8_t, kPatternStride*(2 * kRadius + 1)> patch;
  const uint8_t* in = smoothed.At(x - kRadius, y - kRadius);
  for (int row = 0; row <= 2 * kRadius; ++row) {
    simd::Store(patch.data() + row * kPatternStride, Load8(in + row * smoothed.stride()));
  }
  const int turn = (angle + 2) / 4 % kNumTurns;
  const uint16_t* offset = TurnedPatterns().offsets[static_cast<size_t>(turn)].data();
  Descriptor descriptor;
  for (uint64_t& word : descriptor) {
    word = 0;
    for (int bit = 0; bit < 64; ++bit, offset += 2) {
      word |= static_cast<uint64_t>(patch[offset[0]] < patch[offset[1]]) << bit;
    }
  }
  return descriptor;
}

}  // namespace tessera
