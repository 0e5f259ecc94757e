// The map as a file that viewers of point clouds read.
#pragma once

#include <string>

#include "map/landmark_colors.h"
#include "map/map.h"

namespace tessera {

// PLY, binary and little-endian: a vertex per landmark, in the order of ids. x y z (float): meters (mono: units of the
// map) in the world frame; nx ny nz (float): mean direction to the cameras that saw it; observations (int): how many
// keyframes see it; and, if `colors` has any, red green blue (uchar), a medium gray where none is known.
// `world_from_map`: positions and directions are turned into that world.
std::string PlyFile(const Map& map, const LandmarkColors& colors, const Rigid3& world_from_map = Rigid3::Identity());

}  // namespace tessera
