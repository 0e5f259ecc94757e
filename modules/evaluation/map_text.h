// The map as text that viewers of point clouds read.
#pragma once

#include <string>

#include "geometry/rigid3.h"
#include "map/map.h"

namespace tessera {

// PLY, ASCII: a vertex per landmark, in the order of ids. x y z: meters (mono: units of the map) in the world frame;
// nx ny nz: mean direction to the cameras that saw it; observations: how many keyframes see it.
std::string PlyText(const Map& map, const Rigid3& world_from_map = Rigid3::Identity());

}  // namespace tessera
