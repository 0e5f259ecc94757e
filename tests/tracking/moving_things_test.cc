// What moves by itself is told from the scene by how marks on both go on.
#include "tracking/moving_things.h"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "measurement/keypoint_measurement.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr int64_t kInterval_us = 33'333;

// A board with a point every 5 cm, upright and facing a camera at the beginning of SyntheticWorld's way.
struct Board {
  Eigen::Vector3d middle;
  double half_width_m, half_height_m;
};

struct Picture {
  FeatureFrame features;
  std::vector<char> is_board;  // by keypoint
};

// What the camera sees of the world and of the board in front of it, which hides what is behind.
class Stage {
 public:
  Stage(SensorType sensor, const Board& board) : world_(sensor, 0.3, 5000), board_(board) {
    std::mt19937_64 generator(11);
    for (double y = -board.half_height_m; y <= board.half_height_m; y += kSpacing_m) {
      for (double x = -board.half_width_m; x <= board.half_width_m; x += kSpacing_m) {
        points_.emplace_back(x, y, 0.0);
        descriptors_.push_back({generator(), generator(), generator(), generator()});
      }
    }
  }

  Picture Take(int64_t frame, const Rigid3& world_from_camera, const Eigen::Vector3d& shift_m) {
    const Rigid3 camera_from_world = world_from_camera.Inverse();
    const CameraCalibration& camera = world_.calibration();
    FeatureFrame seen = world_.Take(frame, world_from_camera).features;
    Picture picture;
    picture.features.frame = {frame};
    picture.features.utime_us = kInterval_us * frame;
    picture.features.calibration = camera;
    const Eigen::Vector3d middle = camera_from_world * (board_.middle + shift_m);
    const Eigen::Vector2d middle_px = camera.Project(middle);
    const Eigen::Vector2d half_px =
        camera.fx_px / middle.z() * Eigen::Vector2d(board_.half_width_m, board_.half_height_m);
    for (size_t i = 0; i < seen.keypoints.size(); ++i) {
      const Eigen::Vector2d off_px = Eigen::Vector2d(seen.keypoints[i].x_px, seen.keypoints[i].y_px) - middle_px;
      const bool is_before = PointFromDepth(seen, static_cast<int32_t>(i)).value_or(middle).z() < middle.z();
      if (!is_before && std::abs(off_px.x()) < half_px.x() && std::abs(off_px.y()) < half_px.y()) continue;
      Add(seen.keypoints[i], seen.descriptors[i], false, picture);
    }
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d point = camera_from_world * (board_.middle + shift_m + points_[i]);
      const Eigen::Vector2d pixel = camera.Project(point);
      const bool is_inside =
          pixel.x() > 0.0 && pixel.x() < camera.width_px && pixel.y() > 0.0 && pixel.y() < camera.height_px;
      if (!is_inside) continue;
      Keypoint keypoint{.x_px = static_cast<float>(pixel.x()), .y_px = static_cast<float>(pixel.y()), .score = 100};
      const double disparity_px = camera.fx_px * Baseline(camera) / point.z();
      if (camera.sensor == SensorType::kStereo) keypoint.right_x_px = static_cast<float>(pixel.x() - disparity_px);
      if (camera.sensor == SensorType::kRgbd) keypoint.depth_m = static_cast<float>(point.z());
      Add(keypoint, descriptors_[i], true, picture);
    }
    return picture;
  }

 private:
  static constexpr double kSpacing_m = 0.05;

  static void Add(const Keypoint& keypoint, const Descriptor& descriptor, bool is_board, Picture& picture) {
    picture.features.keypoints.push_back(keypoint);
    picture.features.descriptors.push_back(descriptor);
    picture.is_board.push_back(is_board ? 1 : 0);
  }

  SyntheticWorld world_;
  Board board_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
};

// The shares of the board's keypoints and of all others that are left out.
struct LeftOut {
  double board = 0.0, others = 0.0;
};
LeftOut ShareLeftOut(const MovingThings& things, const Picture& picture) {
  const FeatureFrame without = things.Without(picture.features);
  size_t kept = 0;
  double num_board = 0.0, num_others = 0.0;
  LeftOut out;
  for (size_t i = 0; i < picture.is_board.size(); ++i) {
    const bool is_kept =
        kept < without.descriptors.size() && without.descriptors[kept] == picture.features.descriptors[i];
    kept += is_kept ? 1 : 0;
    const bool is_board = picture.is_board[i] != 0;
    (is_board ? num_board : num_others) += 1.0;
    (is_board ? out.board : out.others) += is_kept ? 0.0 : 1.0;
  }
  EXPECT_EQ(kept, without.keypoints.size());
  out.board /= std::max(1.0, num_board);
  out.others /= std::max(1.0, num_others);
  return out;
}

// A person's size, and one that fills more than half of the image.
const Board kPerson{{0.2, 0.0, 2.5}, 0.3, 0.8};
const Board kClose{{0.1, 0.0, 1.5}, 0.8, 0.8};

Rigid3 SlowPose(int64_t frame) { return SyntheticWorld::Pose(0.03 * static_cast<double>(frame)); }
Rigid3 Standing(int64_t) { return SyntheticWorld::Pose(0.0); }

// What is left out in the last of so many frames, when the board goes aside at this speed.
LeftOut Watch(SensorType sensor, const Board& board, const std::function<Rigid3(int64_t)>& pose, double speed_mps,
              int64_t num_frames) {
  Stage stage(sensor, board);
  MovingThings things;
  LeftOut out;
  for (int64_t frame = 0; frame < num_frames; ++frame) {
    const double way_m = speed_mps * 1e-6 * static_cast<double>(kInterval_us * frame);
    const Picture picture = stage.Take(frame, pose(frame), {way_m, 0.0, 0.0});
    things.Add(picture.features, std::nullopt);
    out = ShareLeftOut(things, picture);
  }
  return out;
}

class MovingThingsOf : public testing::TestWithParam<SensorType> {};
INSTANTIATE_TEST_SUITE_P(WithDepth, MovingThingsOf, testing::Values(SensorType::kStereo, SensorType::kRgbd));

TEST_P(MovingThingsOf, ASceneThatStandsStillIsKept) {
  for (const auto& pose : {std::function(SlowPose), std::function(Standing)}) {
    const LeftOut out = Watch(GetParam(), kPerson, pose, 0.0, 12);
    EXPECT_EQ(out.board, 0.0);
    EXPECT_EQ(out.others, 0.0);
  }
}

TEST_P(MovingThingsOf, SomeoneWhoWalksByIsLeftOut) {
  for (const auto& pose : {std::function(SlowPose), std::function(Standing)}) {
    const LeftOut out = Watch(GetParam(), kPerson, pose, 0.8, 12);
    EXPECT_GT(out.board, 0.8);
    EXPECT_LT(out.others, 0.05);
  }
}

TEST_P(MovingThingsOf, TheSceneIsTheLargerSurfaceNotTheLargerShareOfTheImage) {
  const LeftOut out = Watch(GetParam(), kClose, SlowPose, 0.8, 12);
  EXPECT_GT(out.board, 0.8);
  EXPECT_LT(out.others, 0.05);
}

TEST_P(MovingThingsOf, WhatStopsIsKeptAgain) {
  Stage stage(GetParam(), kPerson);
  MovingThings things;
  Picture picture;
  double left_out_moving = 0.0;
  for (int64_t frame = 0; frame < 30; ++frame) {
    const double way_m = 0.025 * static_cast<double>(std::min<int64_t>(frame, 12));
    picture = stage.Take(frame, SlowPose(frame), {way_m, 0.0, 0.0});
    things.Add(picture.features, std::nullopt);
    if (frame == 12) left_out_moving = ShareLeftOut(things, picture).board;
  }
  EXPECT_GT(left_out_moving, 0.8);
  EXPECT_LT(ShareLeftOut(things, picture).board, 0.05);
}

TEST(MovingThings, OneCameraAloneCantTell) {
  const LeftOut out = Watch(SensorType::kMono, kPerson, SlowPose, 0.8, 12);
  EXPECT_EQ(out.board, 0.0);
  EXPECT_EQ(out.others, 0.0);
}

// The board is nearly as large as what else is seen: what the camera goes on to decides.
TEST(MovingThings, WhatTheCameraGoesOnToIsTheScene) {
  Stage stage(SensorType::kRgbd, {{0.0, 0.0, 3.0}, 2.2, 1.3});
  for (const bool goes_with_board : {false, true}) {
    MovingThings things;
    LeftOut out;
    for (int64_t frame = 0; frame < 8; ++frame) {
      const double way_m = 0.03 * static_cast<double>(frame);
      const Picture picture = stage.Take(frame, Standing(frame), {way_m, 0.0, 0.0});
      const Eigen::Vector3d step(goes_with_board ? -0.03 : 0.0, 0.0, 0.0);
      things.Add(picture.features, ExpectedMotion{{Eigen::Quaterniond::Identity(), step}, 0.005});
      out = ShareLeftOut(things, picture);
    }
    const auto [moving, standing] =
        goes_with_board ? std::pair(out.others, out.board) : std::pair(out.board, out.others);
    EXPECT_GT(moving, 0.2) << goes_with_board;
    EXPECT_LT(standing, 0.1) << goes_with_board;
  }
}

}  // namespace
}  // namespace tessera
