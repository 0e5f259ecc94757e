#include "datasets/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string_view>
#include <utility>

#include "core/errors.h"
#include "core/files.h"
#include "datasets/color_pixels.h"
#include "datasets/png_file.h"
#include "datasets/text_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 12> kExtensions = {".png", ".jpg",  ".jpeg", ".pgm", ".ppm", ".bmp",
                                                          ".tif", ".tiff", ".webp", ".jpe", ".pnm", ".jp2"};

bool HasImageExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

unsigned Byte(const std::string& bytes, size_t at) { return static_cast<unsigned char>(bytes[at]); }

// A JPEG is a list of segments (FF, marker, two bytes of length, ...) up to the start of scan (FF DA); then
// comes entropy-coded data, in which FF D9 can't occur but as the end of the image (ITU-T T.81, B.1.1).
bool IsCompleteJpeg(const std::string& bytes) {
  size_t at = 2;
  while (at + 4 <= bytes.size() && Byte(bytes, at) == 0xFF && Byte(bytes, at + 1) != 0xDA) {
    if (Byte(bytes, at + 1) == 0xFF) {
      ++at;  // fill byte
      continue;
    }
    at += 2 + 256 * Byte(bytes, at + 2) + Byte(bytes, at + 3);
  }
  if (at + 4 > bytes.size() || Byte(bytes, at) != 0xFF) {
    return false;
  }
  const size_t end = bytes.rfind("\xFF\xD9");
  return end != std::string::npos && end > at;
}

// A PNG is a signature of 8 bytes, then chunks (length, type, data, checksum) up to the chunk IEND.
bool IsCompletePng(const std::string& bytes) {
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    size_t length = 0;
    for (size_t i = 0; i < 4; ++i) {
      length = 256 * length + Byte(bytes, at + i);
    }
    if (length + 12 > bytes.size() - at) {
      return false;
    }
    if (bytes.compare(at + 4, 4, "IEND") == 0) {
      return true;
    }
    at += 12 + length;
  }
  return false;
}

bool IsComplete(const std::string& bytes) {
  if (bytes.starts_with("\xFF\xD8")) {
    return IsCompleteJpeg(bytes);
  }
  if (bytes.starts_with("\x89PNG\r\n\x1A\n")) {
    return IsCompletePng(bytes);
  }
  return true;  // other formats: OpenCV refuses a short file
}

std::string ReadWhole(const std::string& path) {
  std::string bytes = ReadFile(path);
  if (!IsComplete(bytes) || bytes.empty()) {
    throw InputError("image " + path + " is truncated after " + std::to_string(bytes.size()) +
                     " bytes: copy it again from its origin");
  }
  return bytes;
}

// What OpenCV makes of the bytes of the file at `path`.
cv::Mat Decode(const std::string& bytes, int flags, const std::string& path) {
  const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8U,
                       const_cast<char*>(bytes.data()));  // imdecode only reads it
  cv::Mat image;
  try {
    image = cv::imdecode(buffer, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();  // same cause, same sentence
  }
  if (image.empty()) {
    throw InputError("image " + path + " can't be decoded: it is damaged or not an image; copy it again");
  }
  return image;
}

template <class Pixel>
Image<Pixel> CopyPixels(const cv::Mat& mat) {
  Image<Pixel> image;
  image.width = mat.cols;
  image.height = mat.rows;
  image.pixels.reserve(mat.total());
  for (int y = 0; y < mat.rows; ++y) {
    const Pixel* row = mat.ptr<Pixel>(y);
    image.pixels.insert(image.pixels.end(), row, row + mat.cols);
  }
  return image;
}

}  // namespace

GrayImage ReadGrayImage(const std::string& path) {
  const std::string bytes = ReadWhole(path);
  if (std::optional<GrayImage> image = GrayOfPng(bytes)) return std::move(*image);
  return CopyPixels<uint8_t>(Decode(bytes, cv::IMREAD_GRAYSCALE, path));
}

ColorImage ReadColorImage(const std::string& path) {
  const std::string bytes = ReadWhole(path);
  if (std::optional<ColorImage> image = ColorOfPng(bytes)) return std::move(*image);
  const cv::Mat image = Decode(bytes, cv::IMREAD_ANYCOLOR, path);
  return image.type() == CV_8UC3 ? ColorsOf(image) : ColorImage();
}

DepthImage ReadDepthImage(const std::string& path) {
  const std::string bytes = ReadWhole(path);
  if (std::optional<DepthImage> image = DepthOfPng(bytes)) return std::move(*image);
  const cv::Mat depth = Decode(bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR, path);
  if (depth.type() != CV_16UC1) {
    throw InputError("depth image " + path +
                     " must have one channel of 16 bits: convert it, for example to a 16-bit PNG");
  }
  return CopyPixels<uint16_t>(depth);
}

std::vector<std::string> ListImages(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (HasImageExtension(it->path())) {
      paths.push_back(it->path().string());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::string FindImage(const std::string& path) {
  if (fs::exists(path)) {
    return path;
  }
  for (const std::string_view extension : kExtensions) {
    const fs::path other = fs::path(path).replace_extension(extension);
    if (fs::exists(other)) {
      return other.string();
    }
  }
  return "";
}

void RequireSize(int width_px, int height_px, int expected_width_px, int expected_height_px, const std::string& what) {
  if (width_px != expected_width_px || height_px != expected_height_px) {
    throw InputError(what + " is " + std::to_string(width_px) + "x" + std::to_string(height_px) + " px, but " +
                     std::to_string(expected_width_px) + "x" + std::to_string(expected_height_px) +
                     " px is what the calibration or the first image says: all images must have one size");
  }
}

}  // namespace tessera
