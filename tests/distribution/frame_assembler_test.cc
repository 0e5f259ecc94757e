#include "distribution/frame_assembler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

const CameraCalibration kCalibration{
    .width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 160, .cy_px = 120};

std::vector<TileFeatures> TilesOf(int64_t frame_id, int64_t previous) {
  CameraFrame frame;
  frame.id = {frame_id};
  frame.left = RectanglesImage(320, 240, static_cast<unsigned>(frame_id));
  Extractor extractor;
  std::vector<TileFeatures> tiles;
  for (TileJob& job : CutFrame(frame, kCalibration, 0, {.lines = 2, .columns = 3}, 4, FeatureOptions{})) {
    job.previous_frame = {previous};
    tiles.push_back(extractor.Extract(job));
  }
  return tiles;
}

TEST(FrameAssembler, ReleasesFramesInOrderWhateverTheOrderOfTiles) {
  std::vector<TileFeatures> all;
  std::vector<FeatureFrame> expected;
  int64_t previous = -1;
  for (const int64_t id : {0, 1, 3, 4, 7}) {  // 2, 5 and 6 were dropped
    const std::vector<TileFeatures> tiles = TilesOf(id, previous);
    all.insert(all.end(), tiles.begin(), tiles.end());
    expected.push_back(SelectFeatures(tiles).value().features);
    previous = id;
  }
  ASSERT_GT(expected[0].keypoints.size(), 100U);
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937 generator(seed);
    std::vector<TileFeatures> arriving = all;
    arriving.insert(arriving.end(), all.begin(), all.begin() + 10);  // some come twice
    std::shuffle(arriving.begin(), arriving.end(), generator);
    FrameAssembler assembler(64);
    std::vector<FeatureFrame> released;
    for (const TileFeatures& tile : arriving) {
      EXPECT_NE(assembler.Add(tile), FrameAssembler::Result::kRefused);
      while (assembler.CanRelease()) released.push_back(assembler.ReleaseNext().value().features);
    }
    ASSERT_EQ(released.size(), expected.size());
    for (size_t i = 0; i < released.size(); ++i) {
      EXPECT_EQ(released[i].frame, expected[i].frame);
      EXPECT_EQ(released[i].keypoints, expected[i].keypoints);
      EXPECT_EQ(released[i].descriptors, expected[i].descriptors);
    }
    EXPECT_EQ(assembler.num_open_frames(), 0);
  }
}

TEST(FrameAssembler, OneThatIsStartedAgainGoesOnBehindWhatIsTracked) {
  FrameAssembler assembler(64);
  for (const TileFeatures& tile : TilesOf(8, 7)) assembler.Add(tile);
  for (const TileFeatures& tile : TilesOf(9, 8)) assembler.Add(tile);
  EXPECT_FALSE(assembler.CanRelease()) << "frame 7 may still lack";
  assembler.SkipTo({7});
  ASSERT_TRUE(assembler.CanRelease());
  EXPECT_EQ(assembler.ReleaseNext().value().features.frame.value, 8);
  assembler.SkipTo({8});
  EXPECT_EQ(assembler.num_open_frames(), 1);
  assembler.SkipTo({9});
  EXPECT_EQ(assembler.num_open_frames(), 0);
  EXPECT_EQ(assembler.Add(TilesOf(9, 8).front()), FrameAssembler::Result::kRepeated);
  EXPECT_EQ(assembler.last_released().value, 9);
}

// Candidates of the frame's tiles with at least these priorities.
std::vector<TileFeatures> CutTilesOf(int64_t frame_id, const std::vector<int32_t>& min_priority) {
  std::vector<TileFeatures> tiles = TilesOf(frame_id, frame_id - 1);
  for (TileFeatures& tile : tiles) {
    const std::vector<Candidate> all = tile.candidates;
    tile.cuts = LeaveOutBelow(min_priority, tile.calibration, tile.candidates);
    std::vector<Descriptor> descriptors;
    for (const Candidate& candidate : tile.candidates) {
      descriptors.push_back(tile.descriptors[static_cast<size_t>(std::ranges::find(all, candidate) - all.begin())]);
    }
    tile.descriptors = descriptors;
  }
  return tiles;
}

TEST(FrameAssembler, AwaitsAllCandidatesWhereTooManyWereLeftOut) {
  const std::vector<TileFeatures> whole = TilesOf(0, -1);
  const Selection expected = SelectFeatures(whole).value();
  const std::vector<TileFeatures> few = CutTilesOf(0, std::vector<int32_t>(kNumLevels, 1 << 28));
  FrameAssembler assembler(64);
  EXPECT_EQ(assembler.Add(whole[1]), FrameAssembler::Result::kKept);
  for (size_t i = 0; i < few.size(); ++i) {
    const auto expected_result = i == 1 ? FrameAssembler::Result::kRepeated : FrameAssembler::Result::kKept;
    EXPECT_EQ(assembler.Add(few[i]), expected_result);
  }
  ASSERT_TRUE(assembler.CanRelease());
  EXPECT_FALSE(assembler.ReleaseNext());
  const std::vector<TileAck> forgotten = assembler.TakeForgotten();
  ASSERT_EQ(forgotten.size(), 1U);
  EXPECT_TRUE(forgotten[0].wants_all);
  EXPECT_EQ(forgotten[0].tiles.size(), few.size() - 1) << "all but tile 1, which brought all it had";
  EXPECT_EQ(assembler.Add(few[0]), FrameAssembler::Result::kTooFew) << "comes late";
  EXPECT_EQ(assembler.Add(few[1]), FrameAssembler::Result::kRepeated);
  for (const TileFeatures& tile : TilesOf(1, 0)) assembler.Add(tile);
  EXPECT_FALSE(assembler.CanRelease()) << "frame 0 comes first";
  for (const int32_t tile : forgotten[0].tiles) {
    EXPECT_EQ(assembler.Add(whole[static_cast<size_t>(tile)]), FrameAssembler::Result::kKept);
  }
  ASSERT_TRUE(assembler.CanRelease());
  const Selection selection = assembler.ReleaseNext().value();
  EXPECT_EQ(selection.features.keypoints, expected.features.keypoints);
  EXPECT_EQ(selection.features.descriptors, expected.features.descriptors);
  EXPECT_EQ(selection.lowest_priority, expected.lowest_priority);
  EXPECT_TRUE(assembler.CanRelease()) << "frame 1";
}

TEST(FrameAssembler, RefusesContradictionsAndFloods) {
  const std::vector<TileFeatures> tiles = TilesOf(0, -1);
  FrameAssembler assembler(2);
  EXPECT_EQ(assembler.Add(tiles[0]), FrameAssembler::Result::kKept);
  EXPECT_EQ(assembler.Add(tiles[0]), FrameAssembler::Result::kRepeated);
  TileFeatures other_count = tiles[1];
  other_count.num_tiles += 1;
  EXPECT_EQ(assembler.Add(other_count), FrameAssembler::Result::kRefused);
  TileFeatures other_frame = tiles[0];
  other_frame.frame = {1};
  EXPECT_EQ(assembler.Add(other_frame), FrameAssembler::Result::kKept);
  other_frame.frame = {2};
  EXPECT_EQ(assembler.Add(other_frame), FrameAssembler::Result::kRefused) << "a third open frame";
}

}  // namespace
}  // namespace tessera
