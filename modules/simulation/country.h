// A rural road: a lap over hills, with stretches where nothing stands near.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "simulation/terrain.h"
#include "simulation/world.h"

namespace tessera {

// What stands beside a part of the road.
struct Stretch {
  enum class Kind {
    kOpen,    // nothing: fields, ridges and sky
    kForest,  // many trees
    kAvenue,  // rows of trees that look alike
    kHedges   // hedges, fences, posts, single trees, barns
  };
  Kind kind = Kind::kOpen;
  double from_m = 0.0;  // along the road
  double to_m = 0.0;
};

struct CountryPlan {
  Polyline road;                   // its middle line; ends where it begins
  Polyline drive;                  // the right lane: the lap, and 150 m of it again
  std::vector<Stretch> stretches;  // in order, without gaps
};

// A lap of 4 km. Its sharpest bends and some other stretches are open: along 90 to 200 m of road, kOpenM before and
// behind a stretch included, nothing stands near. Where the lap begins and closes it is not open. Only the first
// `length_m` are driven; 0: all of it.
CountryPlan PlanCountry(uint32_t seed, double length_m);
// Nothing stands within this distance of an open stretch.
inline constexpr double kOpenM = 35.0;
World BuildCountry(const CountryPlan& plan, const Terrain& terrain, uint32_t seed);

}  // namespace tessera
