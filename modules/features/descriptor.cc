#include "features/descriptor.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "features/pattern.h"
#include "features/simd.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

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

// round(2^22 tan((k + 1/2) / 256 turn)), k = 0 .. 31: the bounds between neighboring angles of the first octant.
constexpr int kTangentBits = 22;  // AngleOf's numbers have 40 bits at most, so products fit 63
constexpr std::array<int64_t, 32> kTangents = {51474,   154485,  257683,  361192,  465140,  569655,  674869,  780918,
                                               887941,  996082,  1105491, 1216326, 1328749, 1442935, 1559067, 1677337,
                                               1797952, 1921133, 2047115, 2176153, 2308520, 2444513, 2584454, 2728694,
                                               2877616, 3031640, 3191228, 3356892, 3529196, 3708768, 3896309, 4092603};

}  // namespace

uint8_t AngleOf(int64_t x, int64_t y) {
  const int64_t larger = std::max(std::abs(x), std::abs(y));
  const int64_t smaller = std::min(std::abs(x), std::abs(y));
  if (larger == 0) return 0;
  const auto bound = std::partition_point(kTangents.begin(), kTangents.end(),
                                          [&](int64_t tangent) { return tangent * larger <= smaller << kTangentBits; });
  auto angle = static_cast<int>(bound - kTangents.begin());
  if (std::abs(y) > std::abs(x)) angle = 64 - angle;
  if (x < 0) angle = 128 - angle;
  if (y < 0) angle = 256 - angle;
  return static_cast<uint8_t>(angle & 255);
}

uint8_t Orientation(const LevelImage& image, int x, int y) {
  // Column sums over all rows give the x moment; differences of the rows y and -y, times y, the y moment. Even and odd
  // columns are kept apart in 16-bit lanes; the largest value is 255 * (1 + .. + 15) = 30600.
  const uint8_t* center = image.At(x - kRadius, y);
  const ptrdiff_t stride = image.stride();
  const U8x32 middle = simd::And(Load8(center), Load8(kDisc[0].data()));
  U16x16 even_sums = simd::EvenBytes(middle);
  U16x16 odd_sums = simd::OddBytes(middle);
  U16x16 y_moments = simd::Fill16(0);
  U16x16 odd_y_moments = y_moments;
  for (int dy = 1; dy <= kRadius; ++dy) {
    const U8x32 disc = Load8(kDisc[static_cast<size_t>(dy)].data());
    const U8x32 below = simd::And(Load8(center + dy * stride), disc);
    const U8x32 above = simd::And(Load8(center - dy * stride), disc);
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

Descriptor Describe(const LevelImage& smoothed, int x, int y, uint8_t angle) {
  // A copy of the patch with a fixed stride makes the turned offsets constants.
  std::array<uint8_t, kPatternStride * (2 * kRadius + 1)> patch;
  const uint8_t* in = smoothed.At(x - kRadius, y - kRadius);
  for (int row = 0; row <= 2 * kRadius; ++row) {
    simd::Store(patch.data() + row * kPatternStride, Load8(in + row * smoothed.stride()));
  }
  const int turn = (angle + 2) / 4 % kNumTurns;
  const uint16_t* offsets = TurnedPatterns().offsets[static_cast<size_t>(turn)].data();
  Descriptor descriptor{};
  for (uint64_t& word : descriptor) {
    // From the highest bit down, each comes in from below. Eight are a loop that is unrolled.
    for (int byte = 7; byte >= 0; --byte) {
      for (int i = 7; i >= 0; --i) {
        const uint16_t* pair = offsets + 2 * (8 * byte + i);
        word = word + word + (patch[pair[0]] < patch[pair[1]] ? 1U : 0U);
      }
    }
    offsets += 128;
  }
  return descriptor;
}

}  // namespace tessera
