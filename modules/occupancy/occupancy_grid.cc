#include "occupancy/occupancy_grid.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace tessera {
namespace {

constexpr double kUprightWeight = 0.1;
constexpr int kTile = 8;  // cells

// Values of ROS's "trinary" mode.
uint8_t GrayOf(VoxelState state) {
  switch (state) {
    case VoxelState::kFree:
      return 254;
    case VoxelState::kOccupied:
      return 0;
    case VoxelState::kUnknown:
      break;
  }
  return 205;
}

// Positions of the camera in the axes of the grid, sorted, so that the closest in the plane is found soon.
class Path {
 public:
  Path(std::span<const Rigid3> world_from_cameras, const Eigen::Matrix3d& world_from_grid) {
    for (const Rigid3& camera : world_from_cameras) {
      positions_.push_back(world_from_grid.transpose() * camera.translation);
    }
    std::sort(positions_.begin(), positions_.end(), [](const auto& a, const auto& b) {
      return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
    });
  }

  // Of the closest position in the plane; of two that are as close, the first.
  double HeightAt(const Eigen::Vector2d& point) const {
    const auto middle = std::lower_bound(positions_.begin(), positions_.end(), point.x(),
                                         [](const auto& position, double x) { return position.x() < x; });
    double best = std::numeric_limits<double>::infinity(), height = 0.0;
    const auto look = [&](const Eigen::Vector3d& position) {
      const double along_x = position.x() - point.x();
      if (along_x * along_x > best) return false;
      const double squared = (position.head<2>() - point).squaredNorm();
      if (squared < best) {
        best = squared;
        height = position.z();
      }
      return true;
    };
    for (auto it = middle; it != positions_.end() && look(*it); ++it) {
    }
    for (auto it = middle; it != positions_.begin() && look(*(it - 1)); --it) {
    }
    return height;
  }

 private:
  std::vector<Eigen::Vector3d> positions_;  // by x
};

// The rectangle of the plane that the known blocks cover.
struct Bounds {
  Eigen::Vector2d lowest = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d highest = -lowest;
};

Bounds BoundsOf(const OccupancyStates& states, const Eigen::Matrix3d& world_from_grid) {
  const double edge = states.resolution() * OccupancyBlock::kSide;
  Bounds bounds;
  for (const auto& [key, block] : states.blocks()) {
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d in_world =
          edge * Eigen::Vector3d(block.x + (corner & 1), block.y + (corner >> 1 & 1), block.z + (corner >> 2));
      const Eigen::Vector2d in_grid = (world_from_grid.transpose() * in_world).head<2>();
      bounds.lowest = bounds.lowest.cwiseMin(in_grid);
      bounds.highest = bounds.highest.cwiseMax(in_grid);
    }
  }
  return bounds;
}

// What stands above a point of the plane.
VoxelState StateAbove(const OccupancyStates& states, const OccupancyGrid& grid, const Eigen::Vector2d& point,
                      double camera_height, const HeightBand& band) {
  VoxelState state = VoxelState::kUnknown;
  const int num_below = static_cast<int>(band.below_camera / grid.resolution);
  const int num_above = static_cast<int>(band.above_camera / grid.resolution);
  for (int i = -num_below; i <= num_above && state != VoxelState::kOccupied; ++i) {
    const Eigen::Vector3d in_grid(point.x(), point.y(), camera_height + i * grid.resolution);
    state = std::max(state, states.At(grid.world_from_grid * in_grid));
  }
  return state;
}

// The cells of one tile, over which the height of the camera's path is taken for level.
void FillTile(const OccupancyStates& states, double camera_height, const HeightBand& band, const Rect& tile,
              OccupancyGrid& grid) {
  for (int y = tile.y; y < std::min(tile.bottom(), grid.cells.height); ++y) {
    for (int x = tile.x; x < std::min(tile.right(), grid.cells.width); ++x) {
      grid.cells.row(y)[x] = StateAbove(states, grid, grid.CenterOf(x, y), camera_height, band);
    }
  }
}

// Without the rows and columns around it in which nothing is known.
OccupancyGrid Trimmed(const OccupancyGrid& grid) {
  int left = grid.cells.width, right = 0, low = grid.cells.height, high = 0;
  for (int y = 0; y < grid.cells.height; ++y) {
    for (int x = 0; x < grid.cells.width; ++x) {
      if (grid.cells.row(y)[x] == VoxelState::kUnknown) continue;
      left = std::min(left, x);
      right = std::max(right, x + 1);
      low = std::min(low, y);
      high = std::max(high, y + 1);
    }
  }
  OccupancyGrid trimmed = grid;
  trimmed.cells = Crop(grid.cells, {left, low, std::max(0, right - left), std::max(0, high - low)});
  trimmed.corner_in_grid += grid.resolution * Eigen::Vector2d(left, low);
  return trimmed;
}

}  // namespace

Eigen::Matrix3d WorldFromGrid(std::span<const Rigid3> world_from_cameras) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Rigid3& camera : world_from_cameras) {
    const Eigen::Matrix3d axes = camera.rotation.toRotationMatrix();
    normal += axes.col(0) * axes.col(0).transpose() + kUprightWeight * Eigen::Matrix3d::Identity();
    right -= kUprightWeight * axes.col(1);
  }
  Eigen::Vector3d up = normal.inverse() * right;
  up = up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : Eigen::Vector3d(-Eigen::Vector3d::UnitY());
  Eigen::Vector3d x = Eigen::Vector3d::UnitX() - up.x() * up;
  if (x.norm() < 0.1) x = Eigen::Vector3d::UnitZ() - up.z() * up;
  x.normalize();
  Eigen::Matrix3d world_from_grid;
  world_from_grid << x, up.cross(x), up;
  return world_from_grid;
}

std::optional<OccupancyGrid> MakeGrid(const OccupancyStates& states, std::span<const Rigid3> world_from_cameras,
                                      const HeightBand& band) {
  if (world_from_cameras.empty() || states.blocks().empty()) return std::nullopt;
  OccupancyGrid grid{.resolution = states.resolution(), .world_from_grid = WorldFromGrid(world_from_cameras)};
  const Path path(world_from_cameras, grid.world_from_grid);
  const Bounds bounds = BoundsOf(states, grid.world_from_grid);
  grid.corner_in_grid = bounds.lowest;
  const Eigen::Vector2d size = (bounds.highest - bounds.lowest) / grid.resolution;
  grid.cells = Image<VoxelState>(static_cast<int>(std::ceil(size.x())), static_cast<int>(std::ceil(size.y())));
  for (int y = 0; y < grid.cells.height; y += kTile) {
    for (int x = 0; x < grid.cells.width; x += kTile) {
      const double height = path.HeightAt(grid.CenterOf(x + kTile / 2, y + kTile / 2));
      FillTile(states, height, band, {x, y, kTile, kTile}, grid);
    }
  }
  return Trimmed(grid);
}

std::string GridImageFile(const OccupancyGrid& grid) {
  const auto& cells = grid.cells;
  std::string file = "P5\n" + std::to_string(cells.width) + " " + std::to_string(cells.height) + "\n255\n";
  for (int y = cells.height - 1; y >= 0; --y) {
    for (int x = 0; x < cells.width; ++x) file.push_back(static_cast<char>(GrayOf(cells.row(y)[x])));
  }
  return file;
}

std::string GridDescriptionFile(const OccupancyGrid& grid, const std::string& image_name) {
  const auto axis = [&](int column) {
    const Eigen::Vector3d direction = grid.world_from_grid.col(column);
    char text[100];
    std::snprintf(text, sizeof text, "[%.9g, %.9g, %.9g]", direction.x(), direction.y(), direction.z());
    return std::string(text);
  };
  char numbers[200];
  std::snprintf(numbers, sizeof numbers, "resolution: %.9g\norigin: [%.9g, %.9g, 0.0]\n", grid.resolution,
                grid.corner_in_grid.x(), grid.corner_in_grid.y());
  return "# The grid's plane in the world of trajectory.txt: x axis " + axis(0) + ", y axis " + axis(1) + ", up " +
         axis(2) + "\nimage: " + image_name + "\nmode: trinary\n" + numbers +
         "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
}

}  // namespace tessera
