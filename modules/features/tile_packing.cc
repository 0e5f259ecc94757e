#include "features/tile_packing.h"

#define ZSTD_STATIC_LINKING_ONLY  // declares ZSTD_c_literalCompressionMode, which the shared library has too
#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace tessera {
namespace {

// Differences are noise, in which little repeats: nearly all of the gain comes from their frequencies (Huffman coding).
// So what repeats is sought in strides, in a third of the time of level 1; runs, which flat images have, are found.
constexpr int kLevel = -100;

// Nothing that a job brings is larger: a false size must not cost memory.
constexpr size_t kMaxPixels = size_t{1} << 28;

// Of numbers, or of vectors of them.
template <class T>
T Predict(T left, T above, T above_left) {
  const T low = left < above ? left : above, high = left < above ? above : left;
  const T gradient = left + above - above_left;
  const T bounded = high < gradient ? high : gradient;
  return low < bounded ? bounded : low;
}

// The bytes of an image's differences: of two bytes the high ones of all pixels come before the low ones, since most
// are zero. `Byte`: const uint8_t to read.
template <class Pixel, class Byte>
struct Differences {
  Byte* high;
  Byte* low;  // one byte: the same

  Differences(Byte* bytes, size_t num_pixels) : high(bytes), low(bytes + (sizeof(Pixel) - 1) * num_pixels) {}

  void Put(size_t i, uint32_t difference) const {
    if constexpr (sizeof(Pixel) > 1) high[i] = static_cast<uint8_t>(difference >> 8U);
    low[i] = static_cast<uint8_t>(difference);
  }
  uint32_t At(size_t i) const {
    if constexpr (sizeof(Pixel) > 1) return uint32_t{high[i]} << 8U | low[i];
    return low[i];
  }
};

template <class Pixel>
size_t IndexOf(const Image<Pixel>& image, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x);
}

// What pixel (x, y) is predicted to be from those before it.
template <class Pixel>
int32_t PredictAt(const Image<Pixel>& image, int x, int y) {
  const Pixel* row = image.row(y);
  if (y == 0) return x > 0 ? row[x - 1] : 0;
  const Pixel* above = image.row(y - 1);
  return x > 0 ? Predict<int32_t>(row[x - 1], above[x], above[x - 1]) : above[0];  // median(0, above, above)
}

// Of a row but for its first pixel. What it reads and writes lies apart, so that it becomes vector instructions.
template <class Pixel>
void PutRow(const Pixel* __restrict row, const Pixel* __restrict above, int width, uint8_t* __restrict high,
            uint8_t* __restrict low) {
  for (int x = 1; x < width; ++x) {
    const auto difference = static_cast<uint32_t>(row[x] - Predict<int32_t>(row[x - 1], above[x], above[x - 1]));
    if constexpr (sizeof(Pixel) > 1) high[x] = static_cast<uint8_t>(difference >> 8U);
    low[x] = static_cast<uint8_t>(difference);
  }
}

template <class Pixel>
void AppendDifferences(const Image<Pixel>& image, std::vector<uint8_t>& bytes) {
  const size_t begin = bytes.size();
  bytes.resize(begin + image.pixels.size() * sizeof(Pixel));
  const Differences<Pixel, uint8_t> differences(bytes.data() + begin, image.pixels.size());
  const auto put = [&](int x, int y) {
    differences.Put(IndexOf(image, x, y), static_cast<uint32_t>(image.row(y)[x] - PredictAt(image, x, y)));
  };
  for (int x = 0; x < image.width && image.height > 0; ++x) put(x, 0);
  for (int y = 1; y < image.height && image.width > 0; ++y) {
    put(0, y);
    const size_t first = IndexOf(image, 0, y);
    PutRow(image.row(y), image.row(y - 1), image.width, differences.high + first, differences.low + first);
  }
}

template <class Pixel>
using ReadableDifferences = Differences<Pixel, const uint8_t>;

template <class Pixel>
void RestorePixel(const ReadableDifferences<Pixel>& differences, int x, int y, Image<Pixel>& image) {
  const auto predicted = static_cast<uint32_t>(PredictAt(image, x, y));
  image.row(y)[x] = static_cast<Pixel>(predicted + differences.At(IndexOf(image, x, y)));
}

constexpr int kLanes = 8;

// A vector of the compiler's, with room for the sum of two pixels less a third.
template <class Pixel>
struct LanesOf {
  using Number = std::conditional_t<sizeof(Pixel) == 1, int16_t, int32_t>;
  typedef Number Type __attribute__((vector_size(sizeof(Number) * kLanes)));
};

// Rows y to y + kLanes - 1 of an image that has the row before them. Each pixel waits for the one to its left, so that
// a row alone takes its time; but a row may follow the one above a pixel behind, and all of these take the same steps:
//
//   lane r at step s: pixel (s - r, y + r)
template <class Pixel>
void RestoreRows(const ReadableDifferences<Pixel>& differences, int y, Image<Pixel>& image) {
  using Lanes = typename LanesOf<Pixel>::Type;
  for (int r = 0; r < kLanes; ++r) {
    for (int x = 0; x < kLanes - r; ++x) RestorePixel(differences, x, y + r, image);
  }
  Lanes left{}, above_left{}, difference{};
  for (int r = 0; r < kLanes; ++r) {
    left[r] = image.row(y + r)[kLanes - r - 1];
    above_left[r] = image.row(y + r - 1)[kLanes - r - 1];
  }
  const Pixel* above_row = image.row(y - 1);
  for (int s = kLanes; s < image.width; ++s) {
    Lanes above = __builtin_shufflevector(left, left, 0, 0, 1, 2, 3, 4, 5, 6);  // that of the lane before, a step ago
    above[0] = above_row[s];
    for (int r = 0; r < kLanes; ++r) {
      difference[r] = static_cast<typename LanesOf<Pixel>::Number>(differences.At(IndexOf(image, s - r, y + r)));
    }
    left = (Predict(left, above, above_left) + difference) & std::numeric_limits<Pixel>::max();
    above_left = above;
    for (int r = 0; r < kLanes; ++r) image.row(y + r)[s - r] = static_cast<Pixel>(left[r]);
  }
  for (int r = 1; r < kLanes; ++r) {
    for (int x = image.width - r; x < image.width; ++x) RestorePixel(differences, x, y + r, image);
  }
}

// The inverse of AppendDifferences, of an image of this size. Returns where the next image begins.
template <class Pixel>
const uint8_t* ReadDifferences(const uint8_t* bytes, const Rect& rect, Image<Pixel>& image) {
  image = rect.empty() ? Image<Pixel>() : Image<Pixel>(rect.width, rect.height);
  const ReadableDifferences<Pixel> differences(bytes, image.pixels.size());
  const auto restore_row = [&](int y) {
    for (int x = 0; x < image.width; ++x) RestorePixel(differences, x, y, image);
  };
  int y = 0;
  if (image.height > 0) restore_row(y++);
  for (; y + kLanes <= image.height && image.width > kLanes; y += kLanes) RestoreRows(differences, y, image);
  for (; y < image.height; ++y) restore_row(y);
  return differences.low + image.pixels.size();
}

// Into as many bytes as it may need. Returns how many it took.
size_t Compress(const std::vector<uint8_t>& from, std::vector<uint8_t>& to) {
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
  const auto checked = [](size_t result) {
    if (ZSTD_isError(result) != 0U) throw std::runtime_error(std::string("Zstandard: ") + ZSTD_getErrorName(result));
    return result;
  };
  checked(ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel));
  // Long strides leave out Huffman coding by themselves.
  checked(ZSTD_CCtx_setParameter(context.get(), ZSTD_c_literalCompressionMode, ZSTD_lcm_huffman));
  return checked(ZSTD_compress2(context.get(), to.data(), to.size(), from.data(), from.size()));
}

size_t NumPixels(const Rect& rect) {
  if (rect.width <= 0 || rect.height <= 0) return 0;
  return static_cast<size_t>(rect.width) * static_cast<size_t>(rect.height);
}

}  // namespace

TileJob PackTile(const TileJob& job) {
  std::vector<uint8_t> differences;
  differences.reserve(job.left.pixels.size() + job.right.pixels.size() + 2 * job.depth.pixels.size());
  AppendDifferences(job.left, differences);
  AppendDifferences(job.right, differences);
  AppendDifferences(job.depth, differences);
  TileJob packed = job;
  packed.left = packed.right = {};
  packed.depth = {};
  std::vector<uint8_t>& bytes = packed.packed.pixels;
  bytes.resize(ZSTD_compressBound(differences.size()));
  const size_t num = Compress(differences, bytes);
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
