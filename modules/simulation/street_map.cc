#include "simulation/street_map.h"

#include <algorithm>
#include <cmath>

namespace tessera {

double LengthOf(const Polyline& line) {
  double length = 0.0;
  for (size_t i = 1; i < line.size(); ++i) {
    length += (line[i] - line[i - 1]).norm();
  }
  return length;
}

Polyline Resample(const Polyline& line, double step_m) {
  Polyline points;
  double to_next = 0.0;  // from the segment's beginning to the next point
  for (size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d step = line[i] - line[i - 1];
    const double length = step.norm();
    for (; to_next < length; to_next += step_m) {
      points.push_back(line[i - 1] + step * (to_next / length));
    }
    to_next -= length;
  }
  return points;
}

Polyline Shift(const Polyline& line, double right_m) {
  Polyline shifted;
  for (size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d along = line[std::min(i + 1, line.size() - 1)] - line[i > 0 ? i - 1 : 0];
    shifted.push_back(line[i] + right_m * RightOf(along.normalized()));
  }
  return shifted;
}

Polyline Shorten(Polyline line, double length_m) {
  if (length_m <= 0.0) return line;
  double length = 0.0;
  for (size_t i = 1; i < line.size(); ++i) {
    length += (line[i] - line[i - 1]).norm();
    if (length >= length_m) {
      line.resize(i + 1);
      break;
    }
  }
  return line;
}

size_t MeterLine::PostAt(double along_m) const {
  return std::min(static_cast<size_t>(std::max(0.0, along_m)), posts_.size() - 1);
}

Eigen::Vector2d MeterLine::AheadAt(double along_m) const {
  const size_t post = PostAt(along_m);
  return (posts_[std::min(post + 1, posts_.size() - 1)] - posts_[post > 0 ? post - 1 : 0]).normalized();
}

Eigen::Vector2d MeterLine::Beside(double along_m, double right_m) const {
  return At(along_m) + right_m * RightOf(AheadAt(along_m));
}

Eigen::Vector2d OnCircle(size_t quarter, double part) {
  // A rational parametrization of each quarter: no trigonometry.
  const double c = (1.0 - part * part) / (1.0 + part * part);
  const double s = 2.0 * part / (1.0 + part * part);
  const Eigen::Vector2d points[] = {{c, s}, {-s, c}, {-c, -s}, {s, -c}};
  return points[quarter % 4];
}

StreetMap::StreetMap(const std::vector<Polyline>& streets) {
  Eigen::Vector2d low(1e9, 1e9);
  Eigen::Vector2d high(-1e9, -1e9);
  for (const Polyline& street : streets) {
    double along = 0.0;
    for (size_t i = 0; i < street.size(); ++i) {
      low = low.cwiseMin(street[i]);
      high = high.cwiseMax(street[i]);
      if (i == 0) continue;
      const Eigen::Vector2d step = street[i] - street[i - 1];
      const double length = step.norm();
      if (length < 1e-6) continue;
      segments_.push_back({street[i - 1], step / length, length, along});
      along += length;
    }
  }
  origin_ = low - Eigen::Vector2d::Constant(kReachM);
  const Eigen::Vector2d extent = high - low + Eigen::Vector2d::Constant(2.0 * kReachM);
  num_columns_ = std::max(1, static_cast<int>(extent.x() / kCellM) + 1);
  num_rows_ = std::max(1, static_cast<int>(extent.y() / kCellM) + 1);
  cells_.resize(static_cast<size_t>(num_columns_) * static_cast<size_t>(num_rows_));
  for (size_t i = 0; i < segments_.size(); ++i) {
    const Segment& segment = segments_[i];
    const Eigen::Vector2d to = segment.from + segment.length_m * segment.direction;
    const Eigen::Vector2d first = (segment.from.cwiseMin(to) - origin_).array() - kReachM;
    const Eigen::Vector2d last = (segment.from.cwiseMax(to) - origin_).array() + kReachM;
    const auto cell_of = [](double offset, int num) {
      return std::clamp(static_cast<int>(offset / kCellM), 0, num - 1);
    };
    for (int row = cell_of(first.y(), num_rows_); row <= cell_of(last.y(), num_rows_); ++row) {
      for (int column = cell_of(first.x(), num_columns_); column <= cell_of(last.x(), num_columns_); ++column) {
        cells_[static_cast<size_t>(row * num_columns_ + column)].push_back(static_cast<int32_t>(i));
      }
    }
  }
}

const std::vector<int32_t>& StreetMap::Near(const Eigen::Vector2d& point) const {
  static const std::vector<int32_t> kNone;
  const Eigen::Vector2d offset = (point - origin_) / kCellM;
  if (offset.x() < 0.0 || offset.y() < 0.0 || offset.x() >= num_columns_ || offset.y() >= num_rows_) {
    return kNone;
  }
  return cells_[static_cast<size_t>(static_cast<int>(offset.y()) * num_columns_ + static_cast<int>(offset.x()))];
}

StreetPosition StreetMap::PositionOf(const Eigen::Vector2d& point) const {
  StreetPosition best;
  double best_squared = kReachM * kReachM;
  for (const int32_t index : Near(point)) {
    const Segment& segment = segments_[static_cast<size_t>(index)];
    const Eigen::Vector2d offset = point - segment.from;
    const double along = std::clamp(offset.dot(segment.direction), 0.0, segment.length_m);
    const double squared = (offset - along * segment.direction).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      const double side = offset.dot(RightOf(segment.direction));
      best = {segment.along_m + along, std::copysign(std::sqrt(squared), side)};
    }
  }
  return best;
}

double StreetMap::DistanceToStreet(const Eigen::Vector2d& point) const { return std::abs(PositionOf(point).lateral_m); }

}  // namespace tessera
