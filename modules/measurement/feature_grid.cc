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
  levels_.resize(placed_.size() + kLanes);
  angles_.resize(placed_.size() + kLanes);
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (cells[i] == num_cells) continue;
    const Keypoint& k = keypoints[i];
    const uint32_t place = next[cells[i]]++;
    placed_[place] = {k.x_px, k.y_px, static_cast<int32_t>(i), k.level, k.angle};
    levels_[place] = k.level;
    angles_[place] = k.angle;
  }
}

}  // namespace tessera
