#include "datasets/png_file.h"

#include <libdeflate.h>
#include <lodepng.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "datasets/color_pixels.h"

namespace tessera {
namespace {

constexpr size_t kSignature = 8;   // bytes before the first chunk
constexpr size_t kHeaderEnd = 33;  // of the first chunk, IHDR
// Chunks that change how libpng turns color into gray, or that add transparency.
constexpr std::array<std::string_view, 5> kOfAnotherKind = {"tRNS", "gAMA", "sRGB", "iCCP", "cHRM"};
constexpr size_t kMaxInflation = 1032;  // of deflate: 258 bytes for 2 bits

struct Free {
  void operator()(uint8_t* bytes) const { std::free(bytes); }  // NOLINT(*-no-malloc,*-owning-memory): LodePNG's
};

// As in the file: rows without padding, channels side by side, the high byte of 16 bits first.
struct Pixels {
  int width = 0;
  int height = 0;
  std::unique_ptr<uint8_t, Free> bytes;
};

size_t RowBytes(const LodePNGInfo& info, unsigned width) {
  return (static_cast<size_t>(width) * lodepng_get_bpp(&info.color) + 7) / 8;
}

// What LodePNG asks of a decompressor of its user's; `custom_context` is the size to come.
unsigned Inflate(unsigned char** out, size_t* out_size, const unsigned char* in, size_t in_size,
                 const LodePNGDecompressSettings* settings) {
  const size_t size = *static_cast<const size_t*>(settings->custom_context);
  if (size > kMaxInflation * in_size) return 1;
  thread_local const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> decompressor(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  *out = static_cast<unsigned char*>(std::malloc(size));  // NOLINT(*-no-malloc,*-owning-memory): LodePNG frees it
  *out_size = size;
  // It checks the sum over all pixels, too.
  return *out != nullptr &&
                 libdeflate_zlib_decompress(decompressor.get(), in, in_size, *out, size, nullptr) == LIBDEFLATE_SUCCESS
             ? 0
             : 1;
}

bool IsOfAnotherKind(const std::string& bytes) {
  const auto* const begin = reinterpret_cast<const unsigned char*>(bytes.data());
  const unsigned char* const end = begin + bytes.size();
  for (const unsigned char* chunk = begin + kSignature; end - chunk >= 12;
       chunk = lodepng_chunk_next_const(chunk, end)) {
    const std::string_view type(reinterpret_cast<const char*>(chunk) + 4, 4);
    if (std::find(kOfAnotherKind.begin(), kOfAnotherKind.end(), type) != kOfAnotherKind.end()) return true;
  }
  return false;
}

std::optional<Pixels> Decode(const std::string& bytes, LodePNGColorType color, unsigned bits) {
  const auto* const data = reinterpret_cast<const unsigned char*>(bytes.data());
  lodepng::State state;
  unsigned width = 0, height = 0;
  if (bytes.size() < kHeaderEnd || lodepng_inspect(&width, &height, &state, data, bytes.size()) != 0) return {};
  const LodePNGInfo& info = state.info_png;
  if (info.color.colortype != color || info.color.bitdepth != bits || info.interlace_method != 0) return {};
  if (IsOfAnotherKind(bytes)) return {};
  const size_t size = (RowBytes(info, width) + 1) * height;  // a row begins with the kind of its filter
  state.decoder.color_convert = 0;
  state.decoder.ignore_crc = 1;  // the header's was checked above, and the sum over the pixels is by Inflate
  state.decoder.zlibsettings.custom_zlib = Inflate;
  state.decoder.zlibsettings.custom_context = &size;
  unsigned char* decoded = nullptr;
  const unsigned error = lodepng_decode(&decoded, &width, &height, &state, data, bytes.size());
  Pixels pixels{.width = static_cast<int>(width), .height = static_cast<int>(height), .bytes = {}};
  pixels.bytes.reset(decoded);
  if (error != 0) return {};
  return pixels;
}

// libpng's weights of red, green and blue, in 1/32768.
uint8_t Gray(const Rgb& color) {
  return static_cast<uint8_t>((9797U * color.red + 19234U * color.green + 3737U * color.blue) >> 15);
}

// All of its pixels, each made of `bytes_per_pixel` bytes by `make`.
template <class Pixel, class Make>
Image<Pixel> ImageOf(const Pixels& pixels, size_t bytes_per_pixel, Make make) {
  Image<Pixel> image(pixels.width, pixels.height);
  const uint8_t* from = pixels.bytes.get();
  for (Pixel& pixel : image.pixels) {
    pixel = make(from);
    from += bytes_per_pixel;
  }
  return image;
}

Rgb ColorAt(const uint8_t* at) { return {.red = at[0], .green = at[1], .blue = at[2]}; }

}  // namespace

std::optional<GrayImage> GrayOfPng(const std::string& bytes) {
  if (const auto gray = Decode(bytes, LCT_GREY, 8)) {
    return ImageOf<uint8_t>(*gray, 1, [](const uint8_t* at) { return *at; });
  }
  if (const auto color = Decode(bytes, LCT_RGB, 8)) {
    return ImageOf<uint8_t>(*color, 3, [](const uint8_t* at) { return Gray(ColorAt(at)); });
  }
  return {};
}

std::optional<ColorImage> ColorOfPng(const std::string& bytes) {
  const auto color = Decode(bytes, LCT_RGB, 8);
  if (!color) return {};
  return NoneIfGray(ImageOf<Rgb>(*color, 3, ColorAt));
}

std::optional<DepthImage> DepthOfPng(const std::string& bytes) {
  const auto depth = Decode(bytes, LCT_GREY, 16);
  if (!depth) return {};
  return ImageOf<uint16_t>(*depth, 2, [](const uint8_t* at) { return static_cast<uint16_t>(at[0] << 8 | at[1]); });
}

}  // namespace tessera
