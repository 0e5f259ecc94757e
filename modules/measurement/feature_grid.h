// Finds the keypoints near a position in the image.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "features/feature_types.h"

namespace tessera {

// What a search asks of every keypoint that it meets, so that it need not look up those that it does not want.
struct PlacedKeypoint {
  float x_px = 0.0F;
  float y_px = 0.0F;
  int32_t index = -1;
  uint8_t level = 0;
  uint8_t angle = 0;
};

// Keypoints sorted into square cells. Within a cell they keep their order, and cells are visited row by row, so a
// search meets keypoints in a fixed order.
class FeatureGrid {
 public:
  FeatureGrid() = default;
  // Keypoints outside the image belong to the nearest cell; those whose position is not finite to none. `takes`: which
  // of the keypoints are sorted in, by index; all if it is empty.
  FeatureGrid(const std::vector<Keypoint>& keypoints, int width_px, int height_px,
              const std::function<bool(int32_t)>& takes = {});

  // Calls visit(placed) for each keypoint with |x - center.x| <= radius_px and |y - center.y| <= radius_px.
  template <class Visit>
  void VisitWindow(const Eigen::Vector2d& center_px, double radius_px, Visit visit) const {
    const int first_column = Column(center_px.x() - radius_px), last_column = Column(center_px.x() + radius_px);
    const int first_row = Row(center_px.y() - radius_px), last_row = Row(center_px.y() + radius_px);
    for (int row = first_row; row <= last_row; ++row) {
      const uint32_t end = CellBegin(row, last_column + 1);
      for (uint32_t k = CellBegin(row, first_column); k < end; ++k) {
        const PlacedKeypoint& placed = placed_[k];
        if (std::abs(placed.x_px - center_px.x()) <= radius_px && std::abs(placed.y_px - center_px.y()) <= radius_px) {
          visit(placed);
        }
      }
    }
  }

  // Calls visit(placed) for each keypoint of the cells that come within radius_px of the segment, and some beside them.
  template <class Visit>
  void VisitSegment(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double radius_px, Visit visit) const {
    const int first_row = Row(std::min(from_px.y(), to_px.y()) - radius_px);
    const int last_row = Row(std::max(from_px.y(), to_px.y()) + radius_px);
    for (int row = first_row; row <= last_row; ++row) {
      const Span span = SegmentInRow(from_px, to_px, radius_px, row);
      const uint32_t end = CellBegin(row, span.last_column + 1);
      for (uint32_t k = CellBegin(row, span.first_column); k < end; ++k) {
        visit(placed_[k]);
      }
    }
  }

 private:
  static constexpr double kCellPx = 16.0;  // a few keypoints a cell at 2000 per image

  struct Span {
    int first_column = 0;
    int last_column = -1;
  };

  // Clamped to the grid; written so that any finite or infinite number is fine.
  int Column(double x_px) const { return Clamp(x_px, num_columns_); }
  int Row(double y_px) const { return Clamp(y_px, num_rows_); }
  static int Clamp(double px, int count) {
    return static_cast<int>(std::clamp(px / kCellPx, 0.0, static_cast<double>(count - 1)));
  }
  uint32_t CellBegin(int row, int column) const {
    return begin_[static_cast<size_t>(row) * static_cast<size_t>(num_columns_) + static_cast<size_t>(column)];
  }
  Span SegmentInRow(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double radius_px, int row) const;

  int num_columns_ = 1;
  int num_rows_ = 1;
  std::vector<PlacedKeypoint> placed_;      // cell after cell, row by row
  std::vector<uint32_t> begin_ = {0U, 0U};  // by cell: its first keypoint; one more at the end
};

}  // namespace tessera
