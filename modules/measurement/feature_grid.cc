#include "measurement/feature_grid.h"

#include <cmath>

namespace tessera {

FeatureGrid::FeatureGrid(const std::vector<Keypoint>& keypoints, int width_px, int height_px,
                         const std::function<bool(int32_t)>& takes)
    : num_columns_(std::max(1, static_cast<int>(std::ceil(width_px / kCellPx)))),
      num_rows_(std::max(1, static_cast<int>(std::ceil(height_px / kCellPx)))) {
  const auto num_cells = static_cast<size_t>(num_columns_) * static_cast<size_t>(num_rows_);
  std::vector<size_t> cells(keypoints.size(), num_cells);  // by keypoint; num_cells: none
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& k = keypoints[i];
    if (!std::isfinite(k.x_px) || !std::isfinite(k.y_px) || (takes && !takes(static_cast<int32_t>(i)))) continue;
    cells[i] =
        static_cast<size_t>(Row(k.y_px)) * static_cast<size_t>(num_columns_) + static_cast<size_t>(Column(k.x_px));
  }
  // Counting sort: count, sum up, place.
  begin_.assign(num_cells + 1, 0U);
  for (const size_t cell : cells) {
    if (cell < num_cells) ++begin_[cell + 1];
  }
  for (size_t cell = 0; cell < num_cells; ++cell) {
    begin_[cell + 1] += begin_[cell];
  }
  placed_.resize(begin_[num_cells]);
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (cells[i] == num_cells) continue;
    const Keypoint& k = keypoints[i];
    placed_[next[cells[i]]++] = {k.x_px, k.y_px, static_cast<int32_t>(i), k.level, k.angle};
  }
}

FeatureGrid::Span FeatureGrid::SegmentInRow(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px,
                                            double radius_px, int row) const {
  // The piece of the segment whose y lies within radius of the row of cells, as parameters 0..1 along it.
  const double top = row * kCellPx - radius_px, bottom = (row + 1) * kCellPx + radius_px;
  const double rise = to_px.y() - from_px.y();
  double begin = 0.0, end = 1.0;
  if (std::abs(rise) > 1e-9) {
    const double a = (top - from_px.y()) / rise, b = (bottom - from_px.y()) / rise;
    begin = std::clamp(std::min(a, b), 0.0, 1.0);
    end = std::clamp(std::max(a, b), 0.0, 1.0);
  }
  const double x_begin = from_px.x() + begin * (to_px.x() - from_px.x());
  const double x_end = from_px.x() + end * (to_px.x() - from_px.x());
  return {Column(std::min(x_begin, x_end) - radius_px), Column(std::max(x_begin, x_end) + radius_px)};
}

}  // namespace tessera
