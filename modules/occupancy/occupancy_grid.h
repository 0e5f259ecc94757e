// The 2-D grid that planners of robots on wheels read: what stands in a band of heights around the camera's path, seen
// from above.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"
#include "geometry/rigid3.h"
#include "occupancy/occupancy_states.h"

namespace tessera {

// m (mono: units of the map), along the direction that is up.
struct HeightBand {
  double below_camera = 1.0;  // lowest height that counts, below the path of the camera
  double above_camera = 0.5;  // highest, above it
};

// Where the plane of the grid lies: its x and y axes and up are the columns, right-handed.
//
// Cameras are carried upright: their x axes are level and their y axes point down, mostly. With x_i and y_i the axes of
// camera i in the world, up is the direction of the u that minimizes
//
//   sum_i (x_i . u)^2 + 0.1 |u + y_i|^2
//
// The first term decides where the camera turned around, whatever it looked down by; the second where it did not. The x
// axis of the grid is the world's, brought to level.
Eigen::Matrix3d WorldFromGrid(std::span<const Rigid3> world_from_cameras);

struct OccupancyGrid {
  double resolution = 0.0;                                   // edge of a cell: that of the voxels
  Eigen::Matrix3d world_from_grid;                           // axes
  Eigen::Vector2d corner_in_grid = Eigen::Vector2d::Zero();  // of the cell in the lower left
  Image<VoxelState> cells;                                   // row 0 has the lowest y

  Eigen::Vector2d CenterOf(int x, int y) const {
    return corner_in_grid + resolution * Eigen::Vector2d(x + 0.5, y + 0.5);
  }
};

// A cell is occupied if a voxel above it within the band is, else free if one is, else unknown. Heights are relative to
// the camera that was closest in the plane, since paths climb. nullopt without cameras or known voxels.
std::optional<OccupancyGrid> MakeGrid(const OccupancyStates& states, std::span<const Rigid3> world_from_cameras,
                                      const HeightBand& band);

// The image of the grid (PGM) as ROS's map_server reads it: free 254, occupied 0, unknown 205, y upward.
std::string GridImageFile(const OccupancyGrid& grid);
// Its description (YAML), which names that file.
std::string GridDescriptionFile(const OccupancyGrid& grid, const std::string& image_name);

}  // namespace tessera
