#include "features/tile_packing.h"

#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace tessera {
namespace {

// Higher levels find no more in noise.
constexpr int kLevel = 1;

// Nothing that a job brings is larger: a false size must not cost memory.
constexpr size_t kMaxPixels = size_t{1} << 28;

int32_t Predict(int32_t left, int32_t above, int32_t above_left) {
  return std::max(std::min(left, above), std::min(std::max(left, above), left + above - above_left));
}

// Calls `visit(i, predicted)` for the pixels of a row from left to right. `above`: the row before it, nullptr: none.
template <class Pixel, class Visit>
void ForRow(const Pixel* row, const Pixel* above, int width, Visit visit) {
  if (above == nullptr) {
    for (int x = 0; x < width; ++x) visit(x, x > 0 ? int32_t{row[x - 1]} : 0);
    return;
  }
  visit(0, int32_t{above[0]});  // median(0, above, above)
  for (int x = 1; x < width; ++x) visit(x, Predict(row[x - 1], above[x], above[x - 1]));
}

// The bytes of differences: of two bytes the high ones of all pixels come before the low ones, since most are zero.
template <class Pixel>
void AppendDifferences(const Image<Pixel>& image, std::vector<uint8_t>& bytes) {
  const size_t num = image.pixels.size();
  const size_t begin = bytes.size();
  bytes.resize(begin + num * sizeof(Pixel));
  uint8_t* const high = bytes.data() + begin;
  uint8_t* const low = high + (sizeof(Pixel) - 1) * num;
  for (int y = 0; y < image.height; ++y) {
    const size_t first = static_cast<size_t>(y) * static_cast<size_t>(image.width);
    const Pixel* row = image.pixels.data() + first;
    ForRow(row, y > 0 ? row - image.width : nullptr, image.width, [&](int x, int32_t predicted) {
      const auto difference = static_cast<uint32_t>(row[x] - predicted);
      const size_t i = first + static_cast<size_t>(x);
      if constexpr (sizeof(Pixel) > 1) high[i] = static_cast<uint8_t>(difference >> 8U);
      low[i] = static_cast<uint8_t>(difference);
    });
  }
}

// The inverse, of an image of this size. Returns where the next image begins.
template <class Pixel>
const uint8_t* ReadDifferences(const uint8_t* bytes, const Rect& rect, Image<Pixel>& image) {
  image.width = rect.width;
  image.height = rect.height;
  const size_t num = static_cast<size_t>(rect.width) * static_cast<size_t>(rect.height);
  image.pixels.resize(num);
  const uint8_t* const high = bytes;
  const uint8_t* const low = high + (sizeof(Pixel) - 1) * num;
  for (int y = 0; y < image.height; ++y) {
    const size_t first = static_cast<size_t>(y) * static_cast<size_t>(image.width);
    Pixel* row = image.pixels.data() + first;
    ForRow<Pixel>(row, y > 0 ? row - image.width : nullptr, image.width, [&](int x, int32_t predicted) {
      const size_t i = first + static_cast<size_t>(x);
      uint32_t difference = low[i];
      if constexpr (sizeof(Pixel) > 1) difference |= static_cast<uint32_t>(high[i]) << 8U;
      row[x] = static_cast<Pixel>(static_cast<uint32_t>(predicted) + difference);
    });
  }
  return low + num;
}

size_t NumPixels(const Rect& rect) {
  if (rect.width <= 0 || rect.height <= 0) return 0;
  return static_cast<size_t>(rect.width) * static_cast<size_t>(rect.height);
}

}  // namespace

TileJob PackTile(const TileJob& job) {
  std::vector<uint8_t> differences;
  AppendDifferences(job.left, differences);
  AppendDifferences(job.right, differences);
  AppendDifferences(job.depth, differences);
  TileJob packed = job;
  packed.left = packed.right = {};
  packed.depth = {};
  std::vector<uint8_t>& bytes = packed.packed.pixels;
  bytes.resize(ZSTD_compressBound(differences.size()));
  const size_t num = ZSTD_compress(bytes.data(), bytes.size(), differences.data(), differences.size(), kLevel);
  if (ZSTD_isError(num) != 0U) throw std::runtime_error(std::string("Zstandard: ") + ZSTD_getErrorName(num));
  bytes.resize(num);
  packed.packed.width = static_cast<int>(num);
  packed.packed.height = 1;
  return packed;
}

Result<> UnpackTile(TileJob& job) {
  const std::vector<uint8_t>& bytes = job.packed.pixels;
  if (bytes.empty()) return {};
  const size_t num = NumPixels(job.left_rect) + NumPixels(job.right_rect) + 2 * NumPixels(job.depth_rect);
  if (num > kMaxPixels) return Failed("its images are larger than any would be");
  std::vector<uint8_t> differences(num);
  if (ZSTD_decompress(differences.data(), num, bytes.data(), bytes.size()) != num) {
    return Failed("its packed images are damaged, or of another size than its rectangles");
  }
  const uint8_t* next = ReadDifferences(differences.data(), job.left_rect, job.left);
  next = ReadDifferences(next, job.right_rect, job.right);
  ReadDifferences(next, job.depth_rect, job.depth);
  job.packed = {};
  return {};
}

}  // namespace tessera
