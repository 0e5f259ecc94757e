// Where each pixel of a rectified image comes from in the original one, in steps of 1/32 px.
//
// Integers only, so that every CPU makes the same bits; for grays they are also those of cv::remap with fixed-point
// maps and bilinear interpolation, in less than half of its time. Places outside of the original image are moved to its
// border.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/image.h"

namespace tessera {

class RemapTable {
 public:
  static constexpr int kSteps = 32;  // to the pixel

  // As cv::initUndistortRectifyMap makes them for CV_16SC2: `whole` holds x and y (two int16_t) of the pixel at the
  // upper left of each place, `fraction` the steps from there (uint16_t, y * kSteps + x), both of the new image's size.
  // The original image has `width` x `height` pixels. Throws InputError if that is less than two either way.
  RemapTable(const cv::Mat& whole, const cv::Mat& fraction, int width, int height);

  // Bilinear interpolation. `image` has the original image's size.
  GrayImage Interpolate(const GrayImage& image) const;
  ColorImage Interpolate(const ColorImage& image) const;
  // The nearest pixel: a mean of two depths is a point where nothing is.
  DepthImage Nearest(const DepthImage& image) const;

 private:
  template <class Pixel>
  Image<Pixel> NewImage() const {
    return Image<Pixel>(new_width_, new_height_);
  }

  int width_;  // of the original image
  int new_width_, new_height_;
  // For each new pixel: the original pixel at its upper left, counted row by row, which has neighbors to the right and
  // below; and the steps from there, 0 .. kSteps.
  std::vector<int32_t> upper_left_;
  std::vector<uint8_t> steps_right_, steps_down_;
};

}  // namespace tessera
