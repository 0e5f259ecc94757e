// Streets of a town, and a way through them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "simulation/street_map.h"

namespace tessera {

// Where the drive waits: what comes from both sides goes first.
struct Stop {
  double at_m = 0.0;  // along the drive
  double wait_s = 0.0;
  Polyline crossing;  // the middle line of the street in front, from left to right
};

// A town and a drive through it.
struct StreetPlan {
  std::vector<Polyline> streets;  // middle lines, m
  Polyline drive;                 // the camera's way, m
  double gap_m = 2.2;             // nothing stands nearer to the drive
  bool has_traffic = true;        // cars come toward the camera
  std::vector<Stop> stops;        // in their order
};

// A walk over the crossings of a small town of bent streets, with several revisits in the same lane and in the other.
// The first `length_m` of the drive are driven; 0: all of it. Of this one, 2.5 km long, the same streets again where
// more is asked for; the others throw InputError then.
StreetPlan PlanTown(uint32_t seed, double length_m);
// One round of blocks that overlaps its beginning by some 40 m.
StreetPlan PlanRound(uint32_t seed, double length_m);
// A block and its first sides again. Where it crosses a street it waits for those who are on it, three times, so far
// before the middle of the crossing.
StreetPlan PlanTraffic(uint32_t seed, double length_m, double stop_m);
// A drive along the true trajectory of a KITTI sequence (rows of 3x4 matrices); heights are ignored. Throws InputError.
StreetPlan PlanFromPoses(const std::string& path, double length_m);

// A walk on pavements once around the block and the first two sides of it again. Every so often it leaves the pavement
// and returns to it; it turns within 3 m.
StreetPlan PlanStroll(uint32_t seed, double length_m);

}  // namespace tessera
