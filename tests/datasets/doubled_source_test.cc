#include "datasets/doubled_source.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>

namespace tessera {
namespace {

// One frame of 3x2 px, and its colors.
class SmallSource : public FrameSource {
 public:
  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override { return 1; }
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  std::optional<CameraFrame> Next() override { return std::exchange(next_, std::nullopt); }
  ColorReader TakeColor() override {
    return [] { return ColorImage(3, 2, {.red = 10, .green = 20, .blue = 30}); };
  }
  bool is_live() const override { return false; }
  const std::vector<std::string>& notes() const override { return notes_; }

  void Tell(const std::string& note) { notes_.push_back(note); }

 private:
  static CameraFrame MakeFrame() {
    CameraFrame frame{.id = FrameId{7}, .utime_us = 700, .sensor = SensorType::kRgbd};
    frame.left = GrayImage(3, 2);
    frame.left.pixels = {0, 16, 32, 160, 176, 192};
    frame.depth = DepthImage(3, 2);
    frame.depth.pixels = {1, 2, 3, 4, 0, 6};
    return frame;
  }

  const CameraCalibration calibration_{.sensor = SensorType::kRgbd,
                                       .width_px = 3,
                                       .height_px = 2,
                                       .fx_px = 300.0,
                                       .fy_px = 310.0,
                                       .cx_px = 1.0,
                                       .cy_px = 0.5,
                                       .depth_unit_m = 0.001};
  const std::vector<GroundTruthPose> ground_truth_;
  std::vector<std::string> notes_ = {"a note"};
  std::optional<CameraFrame> next_ = MakeFrame();
};

TEST(DoubledSource, LeavesImagesThatAreNotSmall) {
  for (const double min_focal_px : {0.0, 300.0}) {
    auto source = std::make_unique<SmallSource>();
    const FrameSource* const own = source.get();
    EXPECT_EQ(DoubleIfSmall(std::move(source), min_focal_px).get(), own);
  }
}

TEST(DoubledSource, BlendsBetweenPixelsAndRepeatsDepths) {
  const auto source = DoubleIfSmall(std::make_unique<SmallSource>(), 301.0);
  const std::optional<CameraFrame> frame = source->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, FrameId{7});
  EXPECT_EQ(frame->utime_us, 700);
  // Slopes go on between the pixels, by quarters of 16 and 160; the border repeats.
  GrayImage expected(6, 4);
  expected.pixels = {0,   4,   12,  20,  28,  32,   //
                     40,  44,  52,  60,  68,  72,   //
                     120, 124, 132, 140, 148, 152,  //
                     160, 164, 172, 180, 188, 192};
  EXPECT_EQ(frame->left, expected);
  EXPECT_TRUE(frame->right.empty());
  DepthImage depths(6, 4);
  depths.pixels = {1, 1, 2, 2, 3, 3, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0, 6, 6, 4, 4, 0, 0, 6, 6};
  EXPECT_EQ(frame->depth, depths);
  EXPECT_EQ(source->TakeColor()(), ColorImage(6, 4, {.red = 10, .green = 20, .blue = 30}));
  EXPECT_FALSE(source->Next());
}

TEST(DoubledSource, ColorsCanBeReadWhenALiveSourceHasGone) {
  auto source = DoubleIfSmall(std::make_unique<SmallSource>(), 301.0);
  const ColorReader read = source->TakeColor();
  source.reset();
  EXPECT_EQ(read(), ColorImage(6, 4, {.red = 10, .green = 20, .blue = 30}));
}

TEST(DoubledSource, ItsCameraSeesTheSamePointsAtTheSamePixels) {
  const SmallSource small;
  const auto source = DoubleIfSmall(std::make_unique<SmallSource>(), 301.0);
  const CameraCalibration& doubled = source->calibration();
  EXPECT_EQ(doubled.width_px, 6);
  EXPECT_EQ(doubled.height_px, 4);
  const Eigen::Vector3d point(0.002, -0.001, 1.5);
  // Pixel x of an image covers pixels 2 x and 2 x + 1 of the doubled one.
  const Eigen::Vector2d pixel = small.calibration().Project(point), half(0.5, 0.5);
  EXPECT_TRUE(doubled.Project(point).isApprox(2.0 * (pixel + half) - half));
}

TEST(DoubledSource, TellsThatItDoublesAndWhatItsSourceTells) {
  auto small = std::make_unique<SmallSource>();
  SmallSource& own = *small;
  const auto source = DoubleIfSmall(std::move(small), 301.0);
  ASSERT_EQ(source->notes().size(), 2U);
  EXPECT_NE(source->notes()[0].find("3x2 px"), std::string::npos);
  EXPECT_EQ(source->notes()[1], "a note");
  own.Tell("another note");
  source->Next();
  ASSERT_EQ(source->notes().size(), 3U);
  EXPECT_EQ(source->notes()[2], "another note");
}

}  // namespace
}  // namespace tessera
