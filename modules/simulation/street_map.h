// Where the streets of a town run. Plane coordinates are the world's (x, z); its y points down.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace tessera {

// Across a street, from its middle: two lanes, parked cars, curb, pavement, then the lots.
inline constexpr double kRoadHalfWidthM = 3.5;
inline constexpr double kCurbM = 5.7;
inline constexpr double kLotLineM = 8.0;

using Polyline = std::vector<Eigen::Vector2d>;

// Points every `step_m` along the polyline, its first one included.
Polyline Resample(const Polyline& line, double step_m);
double LengthOf(const Polyline& line);
// The line shifted to its right.
Polyline Shift(const Polyline& line, double right_m);
// Its first `length_m`; 0: all of it.
Polyline Shorten(Polyline line, double length_m);
// A unit vector: `part` of the way around this quarter of the circle, 0 to 1, not quite evenly.
Eigen::Vector2d OnCircle(size_t quarter, double part);
// The unit vector to the right of direction `d` for someone on the ground (y down: x right when looking along z).
inline Eigen::Vector2d RightOf(const Eigen::Vector2d& d) { return {d.y(), -d.x()}; }

// Positions along a line, in m from its beginning; to the meter.
class MeterLine {
 public:
  explicit MeterLine(const Polyline& line) : posts_(Resample(line, 1.0)) {}

  const Polyline& posts() const { return posts_; }  // every meter
  double length_m() const { return static_cast<double>(posts_.size() - 1); }
  const Eigen::Vector2d& At(double along_m) const { return posts_[PostAt(along_m)]; }
  // Its direction there, a unit vector.
  Eigen::Vector2d AheadAt(double along_m) const;
  // The position at this distance to its right.
  Eigen::Vector2d Beside(double along_m, double right_m) const;

 private:
  size_t PostAt(double along_m) const;

  Polyline posts_;
};

// A position seen from the nearest middle line.
struct StreetPosition {
  double along_m = 0.0;    // from the beginning of that street
  double lateral_m = 1e3;  // to its right; at least 1e3 if no street is within reach
};

class StreetMap {
 public:
  // Middle lines of all streets; they may cross and touch.
  explicit StreetMap(const std::vector<Polyline>& streets);

  // Streets farther than kReachM are not looked for.
  static constexpr double kReachM = 24.0;
  StreetPosition PositionOf(const Eigen::Vector2d& point) const;
  double DistanceToStreet(const Eigen::Vector2d& point) const;

 private:
  struct Segment {
    Eigen::Vector2d from;
    Eigen::Vector2d direction;  // unit
    double length_m;
    double along_m;  // of `from`
  };
  static constexpr double kCellM = 12.0;

  // Segments near the point's cell; empty if there are none.
  const std::vector<int32_t>& Near(const Eigen::Vector2d& point) const;

  std::vector<Segment> segments_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // of the grid of cells
  int num_columns_ = 0;
  int num_rows_ = 0;
  std::vector<std::vector<int32_t>> cells_;  // by row, column: segments that reach within kReachM of it
};

}  // namespace tessera
