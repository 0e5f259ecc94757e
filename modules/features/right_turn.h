// A right camera that looks higher or lower, or is turned about its axis, against its calibration: the rows of the pair
// don't belong together then, and what is looked for in a row isn't there.
#pragma once

#include <optional>
#include <vector>

#include "features/row_offsets.h"
#include "geometry/camera.h"

namespace tessera {

// The right image shows what it should show at (x, y), in units of the focal length from the principal point, at
//
//   (x + pitch x y + twist y,   y + pitch (1 + y^2) - twist x)
//
// to first order.
struct RightTurn {
  double pitch = 0.0;  // rad, upwards
  double twist = 0.0;  // rad, about the optical axis, clockwise as the camera sees it

  // From where a point should be seen to where it is. x, y: px.
  Eigen::Vector2d Shift_px(const CameraCalibration& camera, double x_px, double y_px) const;
  // The most by which any row of the image is off.
  double LargestOffset_px(const CameraCalibration& camera) const;
};

// By least squares over the offsets of several pairs, without those beyond three standard deviations:
//
//   offset = f (pitch (1 + y^2) - twist x + stretch y)
//
// where rows are stretched by a wrong focal length, or because one camera stands ahead of the other; what columns do
// then isn't known from rows, and the stretch is left. nullopt if they don't tell: fewer than two pairs have 40 of
// them, or pairs contradict each other by more than a quarter of a pixel (of cameras that aren't triggered together,
// rows are off as the camera moves).
std::optional<RightTurn> FindRightTurn(const std::vector<std::vector<RowOffset>>& pairs,
                                       const CameraCalibration& camera);

}  // namespace tessera
