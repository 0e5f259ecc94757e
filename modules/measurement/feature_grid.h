// Finds the keypoints near a position in the image.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "features/feature_types.h"
#include "features/simd.h"

namespace tessera {

// What a search asks of every keypoint that it meets, so that it need not look up those that it does not want.
struct PlacedKeypoint {
  float x_px = 0.0F;
  float y_px = 0.0F;
  int32_t index = -1;
  uint8_t level = 0;
  uint8_t angle = 0;
};

// The levels and orientations of keypoints that a search wants; all of them by default.
struct PatchRange {
  uint8_t first_level = 0;
  uint8_t more_levels = 255;  // up to first_level + more_levels
  uint8_t first_angle = 0;    // 1/256 turn
  uint8_t more_angles = 255;  // up to first_angle + more_angles, modulo 256

  static PatchRange Levels(int first, int last) {
    const int first_level = std::max(first, 0);
    return {.first_level = static_cast<uint8_t>(first_level), .more_levels = static_cast<uint8_t>(last - first_level)};
  }
  // The same levels, and orientations (1/256 turn) that differ by 30 degrees at most.
  PatchRange WithAnglesNear(int angle) const {
    constexpr int kMaxDifference = 21;
    PatchRange range = *this;
    range.first_angle = static_cast<uint8_t>(angle - kMaxDifference);
    range.more_angles = 2 * kMaxDifference;
    return range;
  }
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

  // Calls visit(placed) for each keypoint in the range with |x - center.x| <= radius_px and |y - center.y| <=
  // radius_px.
  template <class Visit>
  void VisitWindow(const Eigen::Vector2d& center_px, double radius_px, const PatchRange& range, Visit visit) const {
    const int first_column = Column(center_px.x() - radius_px), last_column = Column(center_px.x() + radius_px);
    const int first_row = Row(center_px.y() - radius_px), last_row = Row(center_px.y() + radius_px);
    for (int row = first_row; row <= last_row; ++row) {
      VisitCells(CellBegin(row, first_column), CellBegin(row, last_column + 1), range,
                 [&](const PlacedKeypoint& placed) {
                   if (std::abs(placed.x_px - center_px.x()) <= radius_px &&
                       std::abs(placed.y_px - center_px.y()) <= radius_px) {
                     visit(placed);
                   }
                 });
    }
  }

  // Calls visit(placed) for each keypoint in the range of the cells that come within radius_px of the segment, and some
  // beside them.
  template <class Visit>
  void VisitSegment(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double radius_px,
                    const PatchRange& range, Visit visit) const {
    const int first_row = Row(std::min(from_px.y(), to_px.y()) - radius_px);
    const int last_row = Row(std::max(from_px.y(), to_px.y()) + radius_px);
    for (int row = first_row; row <= last_row; ++row) {
      const Span span = SegmentInRow(from_px, to_px, radius_px, row);
      VisitCells(CellBegin(row, span.first_column), CellBegin(row, span.last_column + 1), range, visit);
    }
  }

  // Calls visit(placed) for each keypoint in the range.
  template <class Visit>
  void VisitAll(const PatchRange& range, Visit visit) const {
    VisitCells(0U, begin_.back(), range, visit);
  }

 private:
  static constexpr double kCellPx = 16.0;  // a few keypoints a cell at 2000 per image
  static constexpr uint32_t kLanes = 32;   // of a vector

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

  // Visits the placed keypoints [begin, end) that are in the range. Most aren't: they are sorted out 32 at a time.
  template <class Visit>
  void VisitCells(uint32_t begin, uint32_t end, const PatchRange& range, Visit visit) const {
    for (uint32_t k = begin; k < end; k += kLanes) {
      uint32_t in_range = InRange(k, range);
      if (end - k < kLanes) in_range &= (1U << (end - k)) - 1U;
      for (; in_range != 0; in_range &= in_range - 1)
        visit(placed_[k + static_cast<uint32_t>(std::countr_zero(in_range))]);
    }
  }
  // Bit i: whether the placed keypoint first + i is in the range.
  uint32_t InRange(uint32_t first, const PatchRange& range) const {
    const auto beyond = [first](const std::vector<uint8_t>& values, uint8_t begin, uint8_t more) {
      const simd::U8x32 from_begin = simd::Add(simd::Load8(&values[first]), simd::Fill8(static_cast<uint8_t>(-begin)));
      return simd::SubtractSaturated(from_begin, simd::Fill8(more));
    };
    return simd::GreaterMask(simd::Fill8(1), simd::Max(beyond(levels_, range.first_level, range.more_levels),
                                                       beyond(angles_, range.first_angle, range.more_angles)));
  }

  int num_columns_ = 1;
  int num_rows_ = 1;
  std::vector<PlacedKeypoint> placed_;      // cell after cell, row by row
  std::vector<uint8_t> levels_, angles_;    // of these, side by side; a vector may be read from any of them on
  std::vector<uint32_t> begin_ = {0U, 0U};  // by cell: its first keypoint; one more at the end
};

inline FeatureGrid::Span FeatureGrid::SegmentInRow(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px,
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
