#include "occupancy/occupancy_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "occupancy/occupancy_states.h"
#include "support/depth_room.h"

namespace tessera {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr double kVoxel = 0.1;

// Boxes of voxels are put into it, by their corners in the world.
class StatesBuilder {
 public:
  void Fill(const Eigen::Vector3d& from, const Eigen::Vector3d& to, VoxelState state) {
    const octomap::OcTree tree(kVoxel);
    for (double x = from.x() + kVoxel / 2; x < to.x(); x += kVoxel) {
      for (double y = from.y() + kVoxel / 2; y < to.y(); y += kVoxel) {
        for (double z = from.z() + kVoxel / 2; z < to.z(); z += kVoxel) {
          const octomap::OcTreeKey voxel = tree.coordToKey(x, y, z);
          OccupancyBlock& block = blocks_.try_emplace(BlockKeyOf(voxel), EmptyBlock(BlockKeyOf(voxel))).first->second;
          block.Set(PlaceInBlock(voxel), state);
        }
      }
    }
  }
  OccupancyStates Build() const {
    OccupancyStates states(kVoxel);
    for (const auto& [key, block] : blocks_) states.Set({&block, 1});
    return states;
  }

 private:
  std::map<BlockKey, OccupancyBlock> blocks_;
};

VoxelState CellAt(const OccupancyGrid& grid, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector2d in_grid = (grid.world_from_grid.transpose() * point_in_world).head<2>();
  const Eigen::Vector2d cell = (in_grid - grid.corner_in_grid) / grid.resolution;
  return grid.cells.row(static_cast<int>(std::floor(cell.y())))[static_cast<int>(std::floor(cell.x()))];
}

// Cameras that look along z with y down: up is -y.
std::vector<Rigid3> LevelPath() {
  return {CameraAt({0, 0, 0}, 0.0), CameraAt({0, 0, 2.0}, 0.4), CameraAt({1, 0, 2}, 1.2)};
}

TEST(OccupancyGrid, WhatStandsInTheBandIsOccupiedAndTheRestFreeOrUnknown) {
  StatesBuilder builder;
  builder.Fill({-2, -0.3, -2}, {2, 0.3, 2}, VoxelState::kFree);
  builder.Fill({-0.5, -0.3, 1.0}, {0.5, 0.3, 1.2}, VoxelState::kOccupied);  // a post
  builder.Fill({-2, 1.5, -2}, {2, 1.7, 2}, VoxelState::kOccupied);          // the floor, below the band
  const auto grid = MakeGrid(builder.Build(), LevelPath(), {.below_camera = 1.0, .above_camera = 0.5});
  ASSERT_TRUE(grid);
  EXPECT_EQ(CellAt(*grid, {0, 0, 1.1}), VoxelState::kOccupied);
  EXPECT_EQ(CellAt(*grid, {0, 0, 0.5}), VoxelState::kFree);
  EXPECT_NEAR(grid->cells.width * grid->resolution, 4.0, 0.21);
  EXPECT_NEAR(grid->cells.height * grid->resolution, 4.0, 0.21);
}

TEST(OccupancyGrid, TheBandClimbsWithThePath) {
  StatesBuilder builder;
  builder.Fill({-1, -0.2, 0}, {1, 0.2, 0.5}, VoxelState::kFree);
  builder.Fill({-1, -3.2, 8}, {1, -2.8, 8.5}, VoxelState::kOccupied);    // at the camera's height there
  builder.Fill({-1, -3.2, 0.1}, {1, -2.8, 0.4}, VoxelState::kOccupied);  // far above it
  const std::vector<Rigid3> path = {CameraAt({0, 0, 0}, 0.0), CameraAt({0, -3, 8}, 0.0)};
  const auto grid = MakeGrid(builder.Build(), path, {.below_camera = 1.0, .above_camera = 0.5});
  ASSERT_TRUE(grid);
  EXPECT_EQ(CellAt(*grid, {0, 0, 0.25}), VoxelState::kFree);
  EXPECT_EQ(CellAt(*grid, {0, 0, 8.25}), VoxelState::kOccupied);
}

TEST(OccupancyGrid, UpIsFoundFromCamerasThatLookDownAndTurnAround) {
  std::vector<Rigid3> path;
  const Eigen::Quaterniond looks_down = ExpSO3({-0.4, 0, 0});  // about the camera's x axis
  for (int i = 0; i < 12; ++i) path.push_back({ExpSO3({0, 0.5 * i, 0}) * looks_down, {0.1 * i, 0, 0}});
  const Eigen::Matrix3d axes = WorldFromGrid(path);
  EXPECT_GT(axes.col(2).dot(-Eigen::Vector3d::UnitY()), std::cos(0.03));
  EXPECT_TRUE((axes.transpose() * axes).isIdentity(1e-9));
  EXPECT_NEAR(axes.determinant(), 1.0, 1e-9);
}

TEST(OccupancyGrid, WithoutCamerasOrVoxelsThereIsNone) {
  EXPECT_FALSE(MakeGrid(OccupancyStates(kVoxel), LevelPath(), {}));
  StatesBuilder builder;
  builder.Fill({0, 0, 0}, {1, 1, 1}, VoxelState::kFree);
  EXPECT_FALSE(MakeGrid(builder.Build(), {}, {}));
}

TEST(OccupancyGrid, FilesAreThoseOfRosMapServer) {
  OccupancyGrid grid{.resolution = 0.05, .world_from_grid = Eigen::Matrix3d::Identity(), .corner_in_grid = {-1.5, 2}};
  grid.cells = Image<VoxelState>(3, 2);
  grid.cells.row(0)[0] = VoxelState::kOccupied;
  grid.cells.row(1)[2] = VoxelState::kFree;
  const std::string image = GridImageFile(grid);
  EXPECT_THAT(image, StartsWith("P5\n3 2\n255\n"));
  const std::string pixels = image.substr(image.size() - 6);
  EXPECT_EQ(pixels, std::string("\xCD\xCD\xFE\x00\xCD\xCD", 6)) << "the first row is the one with the highest y";
  const std::string text = GridDescriptionFile(grid, "occupancy.pgm");
  EXPECT_THAT(text, HasSubstr("image: occupancy.pgm\n"));
  EXPECT_THAT(text, HasSubstr("resolution: 0.05\norigin: [-1.5, 2, 0.0]\n"));
}

}  // namespace
}  // namespace tessera
