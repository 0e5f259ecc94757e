#include "simulation/terrain.h"

#include <algorithm>
#include <cmath>

#include "simulation/random.h"

namespace tessera {

namespace {

Polyline WithEnd(Polyline posts, const Eigen::Vector2d& end) {
  posts.push_back(end);
  return posts;
}

}  // namespace

Terrain::Terrain(const Polyline& road, uint32_t seed)
    : seed_(seed), posts_(WithEnd(Resample(road, kPostM), road.back())), road_({posts_}) {}

double Terrain::HillAt(const Eigen::Vector2d& point) const {
  const auto wave = [&](uint32_t number, double period_m) {
    return static_cast<double>(PlaneNoise(HashOf(seed_, 51, number), static_cast<float>(point.x() / period_m),
                                          static_cast<float>(point.y() / period_m)));
  };
  return 80.0 * wave(0, 430.0) + 20.0 * wave(1, 190.0);
}

double Terrain::HeightAt(const Eigen::Vector2d& point) const {
  const StreetPosition position = road_.PositionOf(point);
  const double side = std::abs(position.lateral_m);
  if (side >= StreetMap::kReachM) return HillAt(point);
  const double along = std::clamp(position.along_m / kPostM, 0.0, static_cast<double>(posts_.size()) - 1.001);
  const auto post = static_cast<size_t>(along);
  const double road = HillAt(posts_[post] + (along - static_cast<double>(post)) * (posts_[post + 1] - posts_[post]));
  const double t = std::clamp((side - kShoulderM) / (StreetMap::kReachM - kShoulderM), 0.0, 1.0);
  return road + t * t * (3.0 - 2.0 * t) * (HillAt(point) - road);
}

}  // namespace tessera
