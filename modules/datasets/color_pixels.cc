#include "datasets/color_pixels.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace tessera {

ColorImage NoneIfGray(ColorImage image) {
  const bool is_gray = std::all_of(image.pixels.begin(), image.pixels.end(), [](const Rgb& pixel) {
    return pixel.red == pixel.green && pixel.green == pixel.blue;
  });
  return is_gray ? ColorImage() : image;
}

ColorImage ColorsOf(const cv::Mat& image) {
  ColorImage colors(image.cols, image.rows);
  cv::Mat rgb(image.rows, image.cols, CV_8UC3, colors.pixels.data());
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  return NoneIfGray(std::move(colors));
}

}  // namespace tessera
