// An image in square pieces, row by row: where in it something is seen.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/ids.h"
#include "geometry/camera.h"

namespace tessera {

class ImageCells {
 public:
  ImageCells() = default;
  // `num_along` >= 1 along the longer side of the image, if it has as many pixels: the same pieces however the camera
  // stands.
  ImageCells(const CameraCalibration& camera, int num_along) {
    const int longer_px = camera.longer_side_px(), num = std::min(num_along, longer_px);
    size_px_ = static_cast<double>(longer_px) / num;
    const auto num_of = [&](int side_px) {
      return side_px == longer_px ? num : static_cast<int>(std::ceil(side_px / size_px_));
    };
    num_columns_ = num_of(camera.width_px);
    num_rows_ = num_of(camera.height_px);
  }

  int num() const { return num_columns_ * num_rows_; }
  bool empty() const { return num() == 0; }

  // The number of the cell that holds a pixel; of one beside the image, the nearest.
  int Of(double x_px, double y_px) const {
    const auto at = [this](double px, int num) { return static_cast<int>(std::clamp(px / size_px_, 0.0, num - 1.0)); };
    return num_columns_ * at(y_px, num_rows_) + at(x_px, num_columns_);
  }

  // visit(size_t number) of a cell and those around it, in their order.
  template <class Visit>
  void VisitAround(int cell, Visit visit) const {
    const int row = cell / num_columns_, column = cell % num_columns_;
    for (int r = std::max(0, row - 1); r <= std::min(num_rows_ - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(num_columns_ - 1, column + 1); ++c) {
        visit(Index(r * num_columns_ + c));
      }
    }
  }

 private:
  double size_px_ = 1.0;
  int num_columns_ = 0, num_rows_ = 0;
};

}  // namespace tessera
