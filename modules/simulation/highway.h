// A motorway: two lanes each way between guard rails, and a drive along it at speed.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "simulation/drive.h"
#include "simulation/world.h"

namespace tessera {

// What a drive does once: it follows lorries in the right lane, changes to the left one, passes them and changes back.
// Distances are along the drive, m.
struct Overtaking {
  double begin_m = 0.0;
  double changes_m = 0.0;  // to the left lane, along kLaneChangeM
  double returns_m = 0.0;  // to the right one
};
inline constexpr double kLaneChangeM = 80.0;

struct HighwayPlan {
  Polyline middle;  // of the strip between both directions
  Polyline drive;   // the camera's way, on the right of it
  std::vector<Overtaking> overtakings;
};

// 3 km with bends of some 900 m and wider. Only the first `length_m` are driven; 0: all of it.
HighwayPlan PlanHighway(uint32_t seed, double length_m);
// Nothing stands on the lanes. Posts, rails, dashes and panels repeat evenly; besides, signs, bridges, bushes and
// woods.
World BuildHighway(const HighwayPlan& plan, uint32_t seed);
// Lorries that are followed and passed, cars that pass the camera, and the other direction's traffic.
void AddHighwayTraffic(const HighwayPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed,
                       World& world);

// Across, from the middle.
inline constexpr double kInnerLineM = 2.5, kLaneWidthM = 3.75, kOuterLineM = kInnerLineM + 2.0 * kLaneWidthM;
inline constexpr double kHardShoulderM = kOuterLineM + 2.5;
inline constexpr double kLeftLaneM = kInnerLineM + 0.5 * kLaneWidthM, kRightLaneM = kLeftLaneM + kLaneWidthM;

}  // namespace tessera
