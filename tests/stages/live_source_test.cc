// A camera that stalls, breaks off and comes back, played by a fake device: the code is that of V4L2 and RTSP.
#include "stages/camera/live_source.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "core/errors.h"

namespace tessera {
namespace {

// Yields some images and then ends, as a stream does whose server is gone.
class FakeDevice : public FrameSource {
 public:
  // `num_yielded`: counts the images, if it is there.
  FakeDevice(int num_images, int width_px, std::shared_ptr<std::atomic<int>> num_yielded = nullptr)
      : num_left_(num_images), num_yielded_(std::move(num_yielded)) {
    calibration_.width_px = width_px;
    calibration_.height_px = 10;
  }
  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override { return std::nullopt; }
  const std::vector<GroundTruthPose>& ground_truth() const override { return truth_; }
  std::optional<CameraFrame> Next() override {
    if (num_left_-- == 0) return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    CameraFrame frame;
    frame.utime_us = 20'000 * ++stamp_;
    if (num_yielded_) ++*num_yielded_;
    return frame;
  }
  bool is_live() const override { return true; }
  const std::vector<std::string>& notes() const override { return notes_; }

 private:
  CameraCalibration calibration_;
  std::vector<GroundTruthPose> truth_;
  std::vector<std::string> notes_;
  int num_left_;
  std::shared_ptr<std::atomic<int>> num_yielded_;
  int64_t stamp_ = 0;
};

std::vector<CameraFrame> TakeAll(LiveSource& source) {
  std::vector<CameraFrame> frames;
  while (auto frame = source.Next()) frames.push_back(std::move(*frame));
  return frames;
}

TEST(LiveSource, ContinuesWhenTheCameraComesBack) {
  auto num_opened = std::make_shared<std::atomic<int>>(0);
  const auto open = [num_opened]() -> std::unique_ptr<FrameSource> {
    if (++*num_opened == 2) throw InputError("not there yet");
    return std::make_unique<FakeDevice>(5, 20);
  };
  LiveSource source(open, {.last_frame = 8});
  const std::vector<CameraFrame> frames = TakeAll(source);
  EXPECT_EQ(*num_opened, 3);
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back().id.value, 7) << "numbers go on";
  for (size_t i = 1; i < frames.size(); ++i) {
    EXPECT_GT(frames[i].id, frames[i - 1].id);
    EXPECT_GT(frames[i].utime_us, frames[i - 1].utime_us);
  }
  EXPECT_GT(frames.back().utime_us - frames.front().utime_us, 1'000'000) << "by the clock of the host";
  const std::vector<std::string> events = source.TakeEvents();
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0], "the connection to the camera broke off (it ended); it is opened again");
  EXPECT_EQ(events[1], "the camera is connected again");
  EXPECT_TRUE(source.TakeEvents().empty());
}

TEST(LiveSource, KeepsTheNewestOfWhatNobodyTook) {
  auto num_yielded = std::make_shared<std::atomic<int>>(0);
  LiveSource source([&] { return std::make_unique<FakeDevice>(10, 20, num_yielded); }, {.last_frame = 10});
  while (*num_yielded < 10) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // it waits
  EXPECT_TRUE(source.HasNext());
  const auto frame = source.Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id.value, 9);
  EXPECT_GE(frame->age_us, 100'000);
  EXPECT_FALSE(source.Next());
}

TEST(LiveSource, ThrowsIfTheCameraIsNotThereAtTheBeginning) {
  const auto open = []() -> std::unique_ptr<FrameSource> { throw InputError("no such device"); };
  EXPECT_THROW(LiveSource(open, {}), InputError);
}

TEST(LiveSource, AnotherCameraIsNotTakenForTheSame) {
  auto num_opened = std::make_shared<std::atomic<int>>(0);
  const auto open = [num_opened] { return std::make_unique<FakeDevice>(1, ++*num_opened == 1 ? 20 : 30); };
  LiveSource source(open, {});
  EXPECT_THROW(TakeAll(source), InputError);
}

TEST(LiveSource, SaysThatNothingIsThereYet) {
  LiveSource source([] { return std::make_unique<FakeDevice>(0, 20); }, {});
  EXPECT_FALSE(source.HasNext());
}

}  // namespace
}  // namespace tessera
