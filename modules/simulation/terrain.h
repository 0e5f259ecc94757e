// Hills, and a road that lies on them. Plane coordinates are the world's (x, z); heights are meters above y = 0.
#pragma once

#include <cstdint>

#include "simulation/street_map.h"

namespace tessera {

class Terrain {
 public:
  // `road`: a middle line. The ground is level across the road, within kShoulderM of its middle line.
  Terrain(const Polyline& road, uint32_t seed);

  static constexpr double kShoulderM = 14.0;
  double HeightAt(const Eigen::Vector2d& point) const;
  const StreetMap& road() const { return road_; }

 private:
  // Without the road.
  double HillAt(const Eigen::Vector2d& point) const;

  uint32_t seed_;
  static constexpr double kPostM = 2.0;
  Polyline posts_;  // of the middle line, every kPostM; the last one is nearer
  StreetMap road_;
};

}  // namespace tessera
