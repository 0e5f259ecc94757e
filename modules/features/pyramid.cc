#include "features/pyramid.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "features/simd.h"

namespace tessera {
namespace {

// One chunk of a row: 80 output pixels from 96 input pixels, as 5 vector operations of 2 x 8 output pixels, 40 apart.
constexpr int kChunkOutput = 80;
constexpr int kChunkInput = 96;
constexpr int kNumOperations = 5;

// Position 1.2 x + 0.1 below an output pixel x: the pixel to its left, and the tenths beyond that.
constexpr int SourcePixel(int x) { return (12 * x + 1) / 10; }
constexpr int SourceTenths(int x) { return (12 * x + 1) % 10; }

struct ReduceTable {
  std::array<std::array<uint8_t, 16>, kNumOperations> pairs{};
  std::array<std::array<uint8_t, 16>, kNumOperations> weights{};
};

constexpr ReduceTable MakeReduceTable() {
  ReduceTable table;
  for (int operation = 0; operation < kNumOperations; ++operation) {
    for (int i = 0; i < 8; ++i) {
      const int x = 8 * operation + i;
      const int pair = SourcePixel(x) - SourcePixel(8 * operation);
      auto& pairs = table.pairs[static_cast<size_t>(operation)];
      auto& weights = table.weights[static_cast<size_t>(operation)];
      pairs[static_cast<size_t>(2 * i)] = static_cast<uint8_t>(pair);
      pairs[static_cast<size_t>(2 * i + 1)] = static_cast<uint8_t>(pair + 1);
      weights[static_cast<size_t>(2 * i)] = static_cast<uint8_t>(10 - SourceTenths(x));
      weights[static_cast<size_t>(2 * i + 1)] = static_cast<uint8_t>(SourceTenths(x));
    }
  }
  return table;
}

constexpr ReduceTable kReduceTable = MakeReduceTable();

// out = (above * (10 - tenths) + below * tenths + 50) / 100, for rows in tenths; v / 100 = v * 5243 / 2^19 for v <
// 43698.
void CombineRows(const uint16_t* above, const uint16_t* below, int tenths, int width, uint8_t* out) {
  const simd::U16x16 weight_above = simd::Fill16(static_cast<uint16_t>(10 - tenths));
  const simd::U16x16 weight_below = simd::Fill16(static_cast<uint16_t>(tenths));
  const simd::U16x16 half = simd::Fill16(50);
  const simd::U16x16 hundredth = simd::Fill16(5243);
  const auto combine = [&](int x) {
    const simd::U16x16 sum = simd::Add(simd::MultiplyLow(simd::Load16(above + x), weight_above),
                                       simd::MultiplyLow(simd::Load16(below + x), weight_below));
    return simd::ShiftRight<3>(simd::MultiplyHigh(simd::Add(sum, half), hundredth));
  };
  for (int x = 0; x < width; x += 32) simd::Store(out + x, simd::Narrow(combine(x), combine(x + 16)));
}

}  // namespace

Interval Hull(Interval a, Interval b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.begin, b.begin), std::max(a.end, b.end)};
}

int LevelSize(int size, int level) {
  for (int l = 0; l < level; ++l) size = 5 * size / 6;
  return size;
}

float LevelZeroPosition(double x, int level) { return static_cast<float>((x + 0.5) * LevelScale(level) - 0.5); }

int LevelZeroEdge(int half_edges, int level) {
  const auto l = static_cast<size_t>(level);
  return static_cast<int>(half_edges * kPowersOf6[l] / (2 * kPowersOf5[l]));
}

Interval SourceInterval(Interval level_interval) {
  if (level_interval.empty()) return {};
  return {SourcePixel(level_interval.begin), SourcePixel(level_interval.end - 1) + 2};
}

void LevelImage::Reset(const Rect& region) {
  region_ = region;
  stride_ = (kLeftRoom + region.width + kRightRoom + 31) / 32 * 32;
  const size_t size = static_cast<size_t>(stride_) * static_cast<size_t>(region.height);
  if (bytes_.size() < size) bytes_.resize(size);
}

void CopyRegion(const GrayImage& pixels, const Rect& rect, const Rect& region, LevelImage& out) {
  out.Reset(region);
  for (int y = region.y; y < region.bottom(); ++y) {
    std::memcpy(out.At(region.x, y), pixels.row(y - rect.y) + (region.x - rect.x), static_cast<size_t>(region.width));
  }
}

const uint16_t* PyramidReducer::HorizontalRow(const LevelImage& below, int y) {
  const auto slot = static_cast<size_t>(y & 1);
  uint16_t* out = rows_[slot].data();
  if (rows_y_[slot] == y) return out;
  rows_y_[slot] = y;
  const uint8_t* in = below.At(SourcePixel(first_x_), y);
  for (int chunk = 0; chunk < num_chunks_; ++chunk, in += kChunkInput, out += kChunkOutput) {
    for (int operation = 0; operation < kNumOperations; ++operation) {
      const auto i = static_cast<size_t>(operation);
      const uint8_t* source = in + SourcePixel(8 * operation);
      simd::WeightedPairs(source, source + kChunkInput / 2, kReduceTable.pairs[i].data(),
                          kReduceTable.weights[i].data(), out + 8 * operation, out + 8 * operation + kChunkOutput / 2);
    }
  }
  return rows_[slot].data();
}

void PyramidReducer::Reduce(const LevelImage& below, LevelImage& out) {
  const Rect& region = out.region();
  if (region.empty()) return;
  first_x_ = region.x / 5 * 5;
  const int width = region.right() - first_x_;
  num_chunks_ = (width + kChunkOutput - 1) / kChunkOutput;
  const size_t row_size = static_cast<size_t>(num_chunks_) * kChunkOutput + 32;
  for (size_t slot = 0; slot < 2; ++slot) {
    if (rows_[slot].size() < row_size) rows_[slot].resize(row_size);
    rows_y_[slot] = -1;
  }
  for (int y = region.y; y < region.bottom(); ++y) {
    const uint16_t* above = HorizontalRow(below, SourcePixel(y));
    const uint16_t* next = HorizontalRow(below, SourcePixel(y) + 1);
    CombineRows(above, next, SourceTenths(y), width, out.At(first_x_, y));
  }
}

GrayImage ReduceToLevel(const GrayImage& image, int level) {
  const Rect whole{.x = 0, .y = 0, .width = image.width, .height = image.height};
  PyramidReducer reducer;
  LevelImage reduced;
  CopyRegion(image, whole, whole, reduced);
  for (int l = 1; l <= level; ++l) {
    LevelImage below = std::exchange(reduced, {});
    reduced.Reset({.x = 0, .y = 0, .width = LevelSize(image.width, l), .height = LevelSize(image.height, l)});
    reducer.Reduce(below, reduced);
  }
  GrayImage out(reduced.region().width, reduced.region().height);
  for (int y = 0; y < out.height; ++y) std::memcpy(out.row(y), reduced.At(0, y), static_cast<size_t>(out.width));
  return out;
}

}  // namespace tessera
