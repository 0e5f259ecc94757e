#include "occupancy/occupancy_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "support/depth_room.h"
#include "support/map_changes.h"
#include "support/matchers.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

OccupancySessionOptions SessionOptions() { return {.map = RoomOptions()}; }

// A camera that turns around in the room. Every third frame becomes a keyframe.
class Turn {
 public:
  explicit Turn(const OccupancySessionOptions& options = SessionOptions()) : session_(options) {}

  static constexpr int kStep = 3;  // frames from one keyframe to the next
  static FrameId FrameOf(KeyframeId id) { return {kStep * id.value}; }
  static Rigid3 PoseOf(KeyframeId id) { return CameraAt({0.1, 0.0, -0.2}, 0.4 * static_cast<double>(id.value)); }

  OccupancySession& session() { return session_; }
  const Map& map() const { return map_; }

  void SendImage(FrameId frame) {
    CameraFrame image = DepthFrameOf(PoseOf({frame.value / kStep}));
    image.id = frame;
    session_.Receive(image);
  }
  void SendPose(FrameId frame) {
    session_.Receive(PoseEstimate{.frame = frame, .is_keyframe = frame.value % kStep == 0});
  }
  void SendKeyframe(KeyframeId id) {
    KeyframeObservation keyframe{.id = id};
    keyframe.features = *FeaturesOf(id);
    ASSERT_THAT(session_.Receive(keyframe), IsSuccess());
  }
  void AddToMap(KeyframeId id, KeyframeId parent) {
    MapDelta delta;
    delta.new_keyframes.push_back({id, parent, PoseOf(id), FeaturesOf(id)});
    Apply(delta);
  }
  void Apply(const MapDelta& change) {
    const MapDelta delta = WithHash(map_, change);
    ASSERT_THAT(map_.Apply(delta), IsSuccess());
    ASSERT_THAT(session_.Receive(delta), IsSuccess());
  }
  void Move(KeyframeId id, const Rigid3& world_from_camera) {
    MapDelta delta;
    delta.moved_keyframes.push_back({id, world_from_camera});
    Apply(delta);
  }
  void SendAll(int64_t num_keyframes) {
    for (int64_t i = 0; i < num_keyframes; ++i) {
      SendImage(FrameOf({i}));
      SendPose(FrameOf({i}));
      SendKeyframe({i});
      AddToMap({i}, {i - 1});
    }
  }
  void WorkOff() {
    while (session_.Advance()) {
    }
  }

 private:
  static std::shared_ptr<const FeatureFrame> FeaturesOf(KeyframeId id) {
    auto features = std::make_shared<FeatureFrame>();
    features->frame = FrameOf(id);
    features->calibration = kDepthCamera;
    return features;
  }

  OccupancySession session_;
  Map map_;
};

// The map that is made from the scans of these keyframes at once.
OccupancyMap FromScratch(const std::map<KeyframeId, Rigid3>& poses) {
  OccupancyMap map(RoomOptions());
  for (const auto& [id, pose] : poses) map.Put(id, ScanOfRoom(Turn::PoseOf(id)), pose);
  return map;
}

std::map<KeyframeId, Rigid3> PosesOf(const Map& map) {
  std::map<KeyframeId, Rigid3> poses;
  map.keyframes().ForEach(
      [&](KeyframeId id, const Keyframe& keyframe) { poses.emplace(id, keyframe.world_from_camera); });
  return poses;
}

Rigid3 Shifted(const Rigid3& pose, double shift) {
  return Rigid3{Eigen::Quaterniond::Identity(), {shift, 0, 0}} * pose;
}

TEST(OccupancySession, AtTheEndAllScansAreWhereTheirKeyframesAreHoweverTheyCameThere) {
  for (const int num_moved : {1, 5}) {  // few are moved, many are cast anew
    Turn turn;
    turn.SendAll(6);
    turn.WorkOff();
    for (int64_t i = 0; i < num_moved; ++i) {
      turn.Move({i}, Shifted(Turn::PoseOf({i}), 0.3));
      turn.WorkOff();
      turn.Move({i}, Shifted(Turn::PoseOf({i}), 0.301));
    }
    EXPECT_FALSE(turn.session().is_done());
    turn.session().EndMap();
    turn.WorkOff();
    ASSERT_TRUE(turn.session().is_done());
    EXPECT_EQ(turn.session().occupancy()->ColorTreeFile(), FromScratch(PosesOf(turn.map())).ColorTreeFile());
  }
}

TEST(OccupancySession, WhileTheRunGoesOnAScanIsMovedWhenItsKeyframeHasMovedByAVoxel) {
  Turn turn;
  turn.SendAll(2);
  turn.WorkOff();
  const auto is_at = [&](const Rigid3& pose) {
    return turn.session().occupancy()->Find({1})->world_from_camera.translation == pose.translation;
  };
  const Rigid3 near = Shifted(Turn::PoseOf({1}), 0.01), far = Shifted(Turn::PoseOf({1}), 0.2);
  turn.Move({1}, near);
  turn.WorkOff();
  EXPECT_FALSE(is_at(near));
  turn.Move({1}, far);
  turn.WorkOff();
  EXPECT_TRUE(is_at(far));
}

TEST(OccupancySession, TheScanOfARemovedKeyframeMovesAlongWithItsParent) {
  Turn turn;
  turn.SendAll(3);
  turn.WorkOff();
  MapDelta removal;
  removal.removed_keyframes.push_back({2});
  turn.Apply(removal);
  turn.Move({1}, Shifted(Turn::PoseOf({1}), 0.5));
  turn.session().EndMap();
  turn.WorkOff();
  const OccupancyMap::Placed* placed = turn.session().occupancy()->Find({2});
  ASSERT_NE(placed, nullptr);
  EXPECT_TRUE(placed->world_from_camera.translation.isApprox(Shifted(Turn::PoseOf({2}), 0.5).translation));
}

TEST(OccupancySession, OnlyTheLargestPartOfTheMapIsShown) {
  Turn turn;
  turn.SendAll(2);
  for (int64_t i = 2; i < 5; ++i) {
    turn.SendImage(Turn::FrameOf({i}));
    turn.SendKeyframe({i});
    turn.AddToMap({i}, {i == 2 ? -1 : i - 1});
  }
  turn.session().EndMap();
  turn.WorkOff();
  const auto& scans = turn.session().occupancy()->scans();
  EXPECT_EQ(scans.size(), 3U);
  EXPECT_FALSE(scans.contains({0}));
  MapDelta joined;
  joined.changed_parents.push_back({{2}, {1}});
  turn.Apply(joined);
  turn.WorkOff();
  EXPECT_EQ(scans.size(), 5U);
}

TEST(OccupancySession, ImagesMayComeAfterWhatIsSaidOfThem) {
  Turn turn;
  turn.SendPose(Turn::FrameOf({0}));
  turn.SendKeyframe({0});
  turn.AddToMap({0}, {});
  turn.session().EndMap();
  turn.WorkOff();
  EXPECT_FALSE(turn.session().is_done());
  turn.SendImage(Turn::FrameOf({0}));
  turn.WorkOff();
  EXPECT_TRUE(turn.session().is_done());
  EXPECT_EQ(turn.session().num_without_scan(), 0);
}

TEST(OccupancySession, KeyframesWhoseImagesDoNotComeAreCounted) {
  Turn turn;
  turn.SendAll(2);
  turn.SendPose(Turn::FrameOf({2}));
  turn.SendKeyframe({2});
  turn.AddToMap({2}, {1});
  turn.session().EndMap();
  turn.WorkOff();
  EXPECT_FALSE(turn.session().is_done()) << "it may still come";
  turn.session().GiveUp();
  EXPECT_TRUE(turn.session().is_done());
  EXPECT_EQ(turn.session().num_without_scan(), 1);
  EXPECT_EQ(turn.session().occupancy()->scans().size(), 2U);
}

TEST(OccupancySession, TheEndWaitsForAllKeyframesThatTheTrackerSent) {
  Turn turn;
  turn.SendAll(2);
  turn.session().ExpectKeyframes(3);
  turn.session().EndMap();
  turn.WorkOff();
  EXPECT_FALSE(turn.session().is_done());
  turn.SendImage(Turn::FrameOf({2}));
  turn.SendKeyframe({2});
  turn.WorkOff();
  EXPECT_TRUE(turn.session().is_done());
}

TEST(OccupancySession, ImagesOfOtherFramesAreForgottenAndTheRestHasABound) {
  OccupancySessionOptions options = SessionOptions();
  const int64_t image_bytes = 3 * int64_t{kDepthCamera.width_px} * kDepthCamera.height_px;
  options.max_image_bytes = 4 * image_bytes;
  Turn turn(options);
  for (int64_t frame = 0; frame < 6; ++frame) turn.SendImage({frame});
  EXPECT_EQ(turn.session().num_waiting(), 4);
  for (int64_t frame = 0; frame < 3; ++frame) turn.SendPose({frame});
  EXPECT_EQ(turn.session().num_waiting(), 2) << "the keyframe, and the frame of which nothing is known";
  turn.SendImage({1});
  EXPECT_EQ(turn.session().num_waiting(), 2) << "known not to be one";
}

OccupancySessionOptions ColorOptions() {
  OccupancySessionOptions options = SessionOptions();
  options.with_color = true;
  return options;
}

ColorFrame Painted(KeyframeId id) { return {.id = Turn::FrameOf(id), .image = Painted(Rgb{200, 100, 50})}; }

// A stage that is far behind, in bounded memory: what waits on disk comes out as what waits in memory.
TEST(OccupancySession, ImagesThatMemoryHasNoRoomForWaitOnDisk) {
  const TemporaryFolder folder;
  const int64_t image_bytes = 3 * int64_t{kDepthCamera.width_px} * kDepthCamera.height_px;
  for (const bool has_disk : {true, false}) {
    OccupancySessionOptions options = SessionOptions();
    options.max_image_bytes = 2 * image_bytes;
    options.with_color = true;
    if (has_disk) options.scratch_dir = folder.path();
    Turn turn(options);
    for (int64_t i = 0; i < 9; ++i) turn.session().Receive(Painted({i}));
    turn.SendAll(9);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "the file has no name";
    turn.session().EndMap();
    turn.WorkOff();
    if (!has_disk) {
      EXPECT_GT(turn.session().num_without_scan(), 5);
      continue;
    }
    ASSERT_TRUE(turn.session().is_done());
    OccupancySessionOptions roomy = SessionOptions();
    roomy.with_color = true;
    Turn in_memory(roomy);
    for (int64_t i = 0; i < 9; ++i) in_memory.session().Receive(Painted({i}));
    in_memory.SendAll(9);
    in_memory.session().EndMap();
    in_memory.WorkOff();
    EXPECT_EQ(turn.session().occupancy()->ColorTreeFile(), in_memory.session().occupancy()->ColorTreeFile());
  }
}

TEST(OccupancySession, MonoNeedsNoImages) {
  OccupancySession session({.map = {.resolution = 0.1, .max_range = 5.0}});
  Map map;
  std::mt19937 generator(3);
  for (int64_t i = 0; i < 4; ++i) {
    const MapDelta delta = RandomChange(map, generator);
    KeyframeObservation keyframe{.id = {i}};
    keyframe.features = *delta.new_keyframes[0].features;
    ASSERT_THAT(session.Receive(keyframe), IsSuccess());
    ASSERT_THAT(session.Receive(delta), IsSuccess());
    while (session.Advance()) {
    }
  }
  session.EndMap();
  while (session.Advance()) {
  }
  ASSERT_TRUE(session.is_done());
  OccupancyMap scratch({.resolution = 0.1, .max_range = 5.0});
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    scratch.Put(id, std::make_shared<const Scan>(ScanFromLandmarks(map, keyframe, {})), keyframe.world_from_camera);
  });
  EXPECT_FALSE(scratch.Blocks().empty());
  EXPECT_EQ(session.occupancy()->ColorTreeFile(), scratch.ColorTreeFile());
}

TEST(OccupancySession, SettingsThatDoNotFitTheSensorAreRefused) {
  OccupancySession session({.map = {.resolution = 5.0}});
  KeyframeObservation keyframe{.id = {0}};
  keyframe.features.calibration = kDepthCamera;
  EXPECT_THAT(session.Receive(keyframe), IsFailure(testing::HasSubstr("maximum range")));
}

TEST(OccupancySession, ScansWaitForTheirColors) {
  Turn turn(ColorOptions());
  turn.session().Receive(Painted({0}));  // before everything else
  turn.SendAll(2);
  turn.session().EndMap();
  turn.WorkOff();
  EXPECT_EQ(turn.session().num_without_scan(), 1);
  EXPECT_FALSE(turn.session().is_done());
  turn.session().Receive(ColorFrame{.id = Turn::FrameOf({1})});
  turn.session().Receive(ColorFrame{.id = Turn::FrameOf({0})});  // of a camera that was started again
  turn.WorkOff();
  ASSERT_TRUE(turn.session().is_done());
  const OccupancyMap& map = *turn.session().occupancy();
  EXPECT_EQ(PointsOf(*map.Find({0})->scan)[0].color, (Rgb{200, 100, 50}));
  EXPECT_EQ(PointsOf(*map.Find({1})->scan)[0].color, (Rgb{90, 90, 90})) << "there is none, so that it is gray";
}

// A camera that was started again may send frames again before it hears how far the others are.
TEST(OccupancySession, AnImageThatComesAgainTakesNoColorAway) {
  Turn turn(ColorOptions());
  turn.session().Receive(Painted({0}));
  turn.SendAll(1);
  turn.WorkOff();
  turn.SendImage(Turn::FrameOf({0}));
  turn.session().Receive(Painted({0}));
  turn.WorkOff();
  turn.Move({0}, Shifted(Turn::PoseOf({0}), 0.5));  // its scan is cast anew
  turn.session().EndMap();
  turn.WorkOff();
  ASSERT_TRUE(turn.session().is_done());
  EXPECT_EQ(PointsOf(*turn.session().occupancy()->Find({0})->scan)[0].color, (Rgb{200, 100, 50}));
}

TEST(OccupancySession, ScansWhoseColorsDoNotComeAreGray) {
  Turn turn(ColorOptions());
  turn.SendAll(2);
  turn.session().EndMap();
  turn.session().GiveUp();
  turn.WorkOff();
  EXPECT_TRUE(turn.session().is_done());
  EXPECT_EQ(turn.session().occupancy()->ColorTreeFile(), FromScratch(PosesOf(turn.map())).ColorTreeFile());
}

}  // namespace
}  // namespace tessera
