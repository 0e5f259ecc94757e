#include "datasets/remap_table.h"

#include <cstring>
#include <string>

#include "core/errors.h"

namespace tessera {
namespace {

constexpr int kHalf = RemapTable::kSteps / 2;

// A place along one side of the image: index of the pixel before it, and steps from there.
struct Place {
  int pixel;
  int steps;

  // The last pixel has no neighbor after it, but all the steps to it from the one before.
  Place(int whole, int fraction, int size) : pixel(whole), steps(fraction) {
    if (whole < 0) {
      pixel = 0, steps = 0;
    } else if (whole >= size - 1) {
      pixel = size - 2, steps = RemapTable::kSteps;
    }
  }
};

// With the four pixels a b   and right, down in steps of s = 1 / kSteps:
//                      c d
//   (1 - down s) ((1 - right s) a + right s b) + down s ((1 - right s) c + right s d), rounded.
// They are the four bytes of `corners`, a the lowest: both rows are computed at once, in 16 bits each, of which neither
// runs over in the end, whatever is borrowed in between.
uint8_t Blend(uint32_t corners, uint32_t right, uint32_t down) {
  constexpr uint32_t kSteps = RemapTable::kSteps;
  const uint32_t lefts = corners & 0x00FF00FF, rights = corners >> 8 & 0x00FF00FF;
  const uint32_t rows = kSteps * lefts + right * (rights - lefts);
  const uint32_t upper = rows & 0xFFFF, lower = rows >> 16;
  return static_cast<uint8_t>((kSteps * upper + down * (lower - upper) + kHalf * kSteps) / (kSteps * kSteps));
}

uint32_t PixelPair(const uint8_t* pixels) {
  uint16_t pair;
  std::memcpy(&pair, pixels, sizeof(pair));
  return pair;
}

// Fetching the pixels of a row one by one first leaves a loop over it that the compiler makes one of vectors.
void FetchCorners(const uint8_t* pixels, int width, const int32_t* upper_left, std::vector<uint32_t>& corners) {
  for (size_t x = 0; x < corners.size(); ++x) {
    const uint8_t* pixel = pixels + upper_left[x];
    corners[x] = PixelPair(pixel) | PixelPair(pixel + width) << 16;
  }
}

void BlendRow(const std::vector<uint32_t>& corners, const uint8_t* right, const uint8_t* down, uint8_t* blended) {
  const uint32_t* corners_of_row = corners.data();
  const size_t width = corners.size();
  for (size_t x = 0; x < width; ++x) blended[x] = Blend(corners_of_row[x], right[x], down[x]);
}

}  // namespace

RemapTable::RemapTable(const cv::Mat& whole, const cv::Mat& fraction, int width, int height)
    : width_(width), new_width_(whole.cols), new_height_(whole.rows) {
  if (width < 2 || height < 2) {
    throw InputError("images of " + std::to_string(width) + "x" + std::to_string(height) +
                     " px can't be rectified: check the image size in the calibration");
  }
  upper_left_.reserve(whole.total());
  steps_right_.reserve(whole.total());
  steps_down_.reserve(whole.total());
  for (int row = 0; row < whole.rows; ++row) {
    for (int column = 0; column < whole.cols; ++column) {
      const auto& pixel = whole.at<cv::Vec2s>(row, column);
      const int steps = fraction.at<uint16_t>(row, column);
      const Place x(pixel[0], steps % kSteps, width);
      const Place y(pixel[1], steps / kSteps, height);
      upper_left_.push_back(y.pixel * width + x.pixel);
      steps_right_.push_back(static_cast<uint8_t>(x.steps));
      steps_down_.push_back(static_cast<uint8_t>(y.steps));
    }
  }
}

GrayImage RemapTable::Interpolate(const GrayImage& image) const {
  GrayImage result = NewImage<uint8_t>();
  std::vector<uint32_t> corners(static_cast<size_t>(new_width_));
  for (int y = 0; y < new_height_; ++y) {
    const size_t first = static_cast<size_t>(y) * corners.size();
    FetchCorners(image.pixels.data(), width_, upper_left_.data() + first, corners);
    BlendRow(corners, steps_right_.data() + first, steps_down_.data() + first, result.row(y));
  }
  return result;
}

ColorImage RemapTable::Interpolate(const ColorImage& image) const {
  ColorImage result = NewImage<Rgb>();
  for (size_t i = 0; i < result.pixels.size(); ++i) {
    const Rgb* pixel = image.pixels.data() + upper_left_[i];
    const auto blend = [&](uint8_t Rgb::* channel) {
      const uint32_t a = pixel[0].*channel, b = pixel[1].*channel;
      const uint32_t c = pixel[width_].*channel, d = pixel[width_ + 1].*channel;
      return Blend(a | b << 8 | c << 16 | d << 24, steps_right_[i], steps_down_[i]);
    };
    result.pixels[i] = {blend(&Rgb::red), blend(&Rgb::green), blend(&Rgb::blue)};
  }
  return result;
}

DepthImage RemapTable::Nearest(const DepthImage& image) const {
  DepthImage result = NewImage<uint16_t>();
  const uint16_t* from = image.pixels.data();
  uint16_t* to = result.pixels.data();
  for (size_t i = 0; i < result.pixels.size(); ++i) {
    const int right = steps_right_[i] >= kHalf ? 1 : 0, down = steps_down_[i] >= kHalf ? width_ : 0;
    to[i] = from[upper_left_[i] + right + down];
  }
  return result;
}

}  // namespace tessera
