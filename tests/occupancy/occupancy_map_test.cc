#include "occupancy/occupancy_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <random>
#include <sstream>

#include "messages/occupancy_types.h"
#include "occupancy/occupancy_states.h"
#include "occupancy/voxel_blocks.h"
#include "support/depth_room.h"

namespace tessera {
namespace {

struct View {
  OccupancyMap::SharedScan scan;
  Rigid3 world_from_camera;
};

std::vector<View> ViewsOfRoom(int num) {
  std::vector<View> views;
  for (int i = 0; i < num; ++i) {
    const Rigid3 pose = CameraAt({0.05 * i - 0.3, 0.1, 0.02 * i}, 0.5 * i);
    views.push_back({ScanOfRoom(pose), pose});
  }
  return views;
}

OccupancyMap MapOf(const std::vector<View>& views) {
  OccupancyMap map(RoomOptions());
  for (size_t i = 0; i < views.size(); ++i) {
    map.Put({static_cast<int64_t>(i)}, views[i].scan, views[i].world_from_camera);
  }
  return map;
}

OccupancyStates StatesOf(const OccupancyMap& map) {
  OccupancyStates states(map.options().resolution);
  states.Set(map.Blocks());
  return states;
}

void ExpectSame(const OccupancyMap& a, const OccupancyMap& b) {
  EXPECT_EQ(a.Blocks(), b.Blocks());
  EXPECT_EQ(a.ColorTreeFile(), b.ColorTreeFile());
  EXPECT_EQ(StatesOf(a).BinaryTreeFile(), StatesOf(b).BinaryTreeFile());
}

TEST(OccupancyMap, TheRoomIsFreeItsWallsAreOccupiedAndBehindThemNothingIsKnown) {
  const OccupancyMap map = MapOf(ViewsOfRoom(13));
  const OccupancyStates states = StatesOf(map);
  for (const double side : {-0.8, 0.0, 0.8}) {
    EXPECT_EQ(states.At({side, 0.0, 1.0}), VoxelState::kFree) << side;
    EXPECT_EQ(states.At({side, 0.0, kRoomHalf + 0.001}), VoxelState::kOccupied) << side;
    EXPECT_EQ(states.At({side, 0.0, kRoomHalf + 0.25}), VoxelState::kUnknown) << side;
    EXPECT_EQ(states.At({kRoomHalf + 0.25, side, 0.0}), VoxelState::kUnknown) << side;
  }
}

TEST(OccupancyMap, MovedScansGiveTheMapThatIsMadeWithThemThereFromTheBeginning) {
  std::vector<View> views = ViewsOfRoom(9);
  OccupancyMap map = MapOf(views);
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> draw(-0.2, 0.2);
  for (int round = 0; round < 3; ++round) {
    for (size_t i = 0; i < views.size(); i += 2) {
      View& view = views[i];
      const Rigid3 motion{ExpSO3({draw(generator), draw(generator), draw(generator)}),
                          {draw(generator), draw(generator), draw(generator)}};
      view.world_from_camera = motion * view.world_from_camera;
      map.Put({static_cast<int64_t>(i)}, view.scan, view.world_from_camera);
    }
    ExpectSame(map, MapOf(views));
  }
}

TEST(OccupancyMap, TheOrderOfScansDoesNotMatter) {
  const std::vector<View> views = ViewsOfRoom(6);
  OccupancyMap map(RoomOptions());
  for (size_t i = views.size(); i-- > 0;) {
    map.Put({static_cast<int64_t>(i)}, views[i].scan, views[i].world_from_camera);
  }
  ExpectSame(map, MapOf(views));
}

TEST(OccupancyMap, ARemovedScanLeavesNoTrace) {
  std::vector<View> views = ViewsOfRoom(6);
  OccupancyMap map = MapOf(views);
  map.Remove({5});
  map.Remove({5});
  EXPECT_EQ(map.Find({5}), nullptr);
  views.pop_back();
  ExpectSame(map, MapOf(views));
  map.Clear();
  EXPECT_TRUE(map.Blocks().empty());
}

TEST(OccupancyMap, AScanCountsOnceForAVoxel) {
  const std::vector<View> views = ViewsOfRoom(1);
  OccupancyMap map = MapOf(views);
  const std::string once = map.ColorTreeFile();
  map.Put({0}, views[0].scan, views[0].world_from_camera);
  EXPECT_EQ(map.ColorTreeFile(), once);
}

TEST(OccupancyMap, WhatTooFewScansHitIsNotKnown) {
  OccupancyOptions options = RoomOptions();
  options.min_hits = 2;
  OccupancyMap map(options);
  const View view = ViewsOfRoom(1)[0];
  map.Put({0}, view.scan, view.world_from_camera);
  EXPECT_EQ(StatesOf(map).Num(VoxelState::kOccupied), 0);
  EXPECT_GT(StatesOf(map).Num(VoxelState::kFree), 0);
  map.Put({1}, view.scan, view.world_from_camera);
  EXPECT_EQ(StatesOf(map).Num(VoxelState::kOccupied), StatesOf(MapOf({view})).Num(VoxelState::kOccupied));
}

TEST(OccupancyMap, OnlyWhatChangedIsTold) {
  std::vector<View> views = ViewsOfRoom(5);
  OccupancyMap map = MapOf(views);
  OccupancyStates told(map.options().resolution);
  told.Set(map.TakeChangedBlocks());
  EXPECT_THAT(map.TakeChangedBlocks(), testing::IsEmpty());
  map.Put({2}, views[2].scan, CameraAt({0.4, 0.0, 0.4}, 1.0));
  map.Remove({4});
  told.Set(map.TakeChangedBlocks());
  EXPECT_EQ(told.blocks(), StatesOf(map).blocks());
  map.Clear();
  told.Set(map.TakeChangedBlocks());
  EXPECT_TRUE(told.blocks().empty());
}

constexpr Rgb kRed{200, 10, 0}, kBlue{0, 10, 100};

TEST(OccupancyMap, OccupiedVoxelsAreToldWithTheirColorsOnceAScanIsInColor) {
  const Rigid3 pose = ViewsOfRoom(1)[0].world_from_camera;
  OccupancyMap map(RoomOptions());
  map.Put({0}, ScanOfRoom(pose), pose);
  std::vector<OccupancyBlock> blocks = map.TakeChangedBlocks();
  EXPECT_THAT(map.ColorsOf(blocks), testing::IsEmpty()) << "all is gray";
  map.Put({0}, ScanOfRoom(pose, Painted(kRed)), pose);
  EXPECT_EQ(map.TakeChangedBlocks(), blocks) << "the same states, in color now, also those of free space";
  const int64_t num_occupied = StatesOf(map).Num(VoxelState::kOccupied);
  EXPECT_EQ(map.ColorsOf(blocks), std::vector<Rgb>(static_cast<size_t>(num_occupied), kRed));
  map.Put({1}, ScanOfRoom(pose, Painted(kBlue)), pose);
  blocks = map.TakeChangedBlocks();
  EXPECT_THAT(blocks, testing::Each(testing::ResultOf([](const auto& b) { return b.NumOccupied(); }, testing::Gt(0))));
  EXPECT_EQ(map.ColorsOf(blocks), std::vector<Rgb>(static_cast<size_t>(num_occupied), (Rgb{100, 10, 50})));
  EXPECT_THAT(map.TakeChangedBlocks(), testing::IsEmpty());
}

TEST(OccupancyStates, KeepsTheColorsOfBlocksAndWritesThemForOctomap) {
  const Rigid3 pose = ViewsOfRoom(1)[0].world_from_camera;
  OccupancyMap map(RoomOptions());
  map.Put({0}, ScanOfRoom(pose, Painted(kRed)), pose);
  const std::vector<OccupancyBlock> blocks = map.Blocks();
  OccupancyStates states(map.options().resolution);
  const auto color_of_wall = [&] {
    std::istringstream file(states.ColorTreeFile());
    const std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(file));
    auto* const tree = dynamic_cast<octomap::ColorOcTree*>(read.get());
    EXPECT_NE(tree, nullptr);
    octomap::ColorOcTreeNode* const wall = tree == nullptr ? nullptr : tree->search(0.0, 0.0, kRoomHalf + 0.01);
    EXPECT_TRUE(wall != nullptr && tree->isNodeOccupied(wall));
    return wall == nullptr ? octomap::ColorOcTreeNode::Color() : wall->getColor();
  };
  states.Set(blocks, map.ColorsOf(blocks));
  EXPECT_EQ(color_of_wall(), octomap::ColorOcTreeNode::Color(kRed.red, kRed.green, kRed.blue));
  states.Set(blocks);
  EXPECT_EQ(color_of_wall(), octomap::ColorOcTreeNode::Color(255, 255, 255)) << "not known any more";
  states.Clear();
  EXPECT_TRUE(states.blocks().empty());
}

TEST(OccupancyMap, OctomapReadsItsFiles) {
  const OccupancyMap map = MapOf(ViewsOfRoom(8));
  const OccupancyStates states = StatesOf(map);
  std::istringstream binary(states.BinaryTreeFile());
  octomap::OcTree tree(1.0);
  ASSERT_TRUE(tree.readBinary(binary));
  EXPECT_DOUBLE_EQ(tree.getResolution(), 0.1);
  std::istringstream colors(map.ColorTreeFile());
  const std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(colors));
  auto* colored = dynamic_cast<octomap::ColorOcTree*>(read.get());
  ASSERT_NE(colored, nullptr);
  const octomap::OcTreeNode* wall = tree.search(0.0, 0.0, kRoomHalf + 0.01);
  const octomap::ColorOcTreeNode* painted = colored->search(0.0, 0.0, kRoomHalf + 0.01);
  ASSERT_TRUE(wall != nullptr && painted != nullptr);
  EXPECT_TRUE(tree.isNodeOccupied(wall) && colored->isNodeOccupied(painted));
  EXPECT_EQ(painted->getColor(), octomap::ColorOcTreeNode::Color(90, 90, 90));
  const octomap::OcTreeNode* air = tree.search(0.0, 0.0, 1.0);
  ASSERT_NE(air, nullptr);
  EXPECT_FALSE(tree.isNodeOccupied(air));
  EXPECT_EQ(tree.search(0.0, 0.0, 3.0), nullptr);
}

TEST(OccupancyMap, OptionsThatMakeNoSenseAreRefused) {
  EXPECT_THROW(OccupancyMap({.resolution = 0.0}), std::logic_error);
  EXPECT_THROW(OccupancyMap({.resolution = 0.1, .max_range = 0.1}), std::logic_error);
  EXPECT_THROW(OccupancyMap({.prob_hit = 0.4}), std::logic_error);
}

TEST(VoxelBlocks, AVoxelIsFoundByItsBlockAndItsPlaceInIt) {
  for (const octomap::OcTreeKey& voxel :
       {octomap::OcTreeKey(0, 0, 0), octomap::OcTreeKey(32767, 32768, 40000), octomap::OcTreeKey(65535, 17, 65535)}) {
    EXPECT_EQ(VoxelAt(BlockKeyOf(voxel), PlaceInBlock(voxel)), voxel);
    EXPECT_EQ(KeyOf(EmptyBlock(BlockKeyOf(voxel))), BlockKeyOf(voxel));
  }
}

}  // namespace
}  // namespace tessera
