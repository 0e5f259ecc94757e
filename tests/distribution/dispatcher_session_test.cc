#include "distribution/dispatcher_session.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/matchers.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

constexpr int64_t kEpochUs = 1'000'000;  // when the dispatcher was started
constexpr int64_t kCameraEpochUs = 900'000;
constexpr int64_t kReassemblerEpochUs = 800'000;
constexpr int64_t kTimeoutUs = DispatcherSession::kLastFrameTimeoutUs;
const CameraCalibration kCalibration{
    .width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 160, .cy_px = 120};

CameraFrame Frame(int64_t id, int width = 320) {
  CameraFrame frame;
  frame.id = {id};
  frame.left = RectanglesImage(width, 240, 1);
  return frame;
}

class Dispatcher {
 public:
  explicit Dispatcher(int max_queued_frames = 32, int64_t max_kept_bytes = 1'000'000)
      : session({.queue = {.max_queued_frames = max_queued_frames},
                 .epoch_us = kEpochUs,
                 .max_kept_bytes = max_kept_bytes}) {}

  void Calibrate() { session.Receive(kCalibration); }
  void Send(int64_t id) { Send(Frame(id)); }
  void Send(const CameraFrame& frame) { session.Receive(frame, {kCameraEpochUs, kEpochUs + 1, kEpochUs + 2}, 0); }
  // A frame that was sent before the dispatcher was started.
  void SendOld(int64_t id) { session.Receive(Frame(id), {kCameraEpochUs, kEpochUs - 1, kEpochUs + 2}, 0); }
  void EndCamera(int64_t num_frames) {
    session.Receive(EndOfStream{.stage = StageKind::kCamera, .num_frames = num_frames, .num_dropped = 0}, 0);
  }
  // One extractor and the reassembler are there, and do all the work. Returns the frames.
  std::vector<int64_t> WorkOffAll() {
    std::vector<int64_t> frames;
    session.Receive(ExtractorReady{.extractor = 0, .epoch_us = 1}, 0);
    session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs);
    while (session.CanGive()) {
      const TileJob job = *session.GiveNext(0).job;
      session.Receive(TileAck{.frame = job.frame, .tiles = {job.tile}}, kReassemblerEpochUs);
      EXPECT_THAT(session.MarkTracked(job.frame), IsSuccess());
      frames.push_back(job.frame.value);
    }
    return frames;
  }

  DispatcherSession session;
};

using Frames = std::vector<int64_t>;

TEST(DispatcherSession, FramesWaitForTheirCalibration) {
  Dispatcher dispatcher;
  for (int64_t id = 0; id < 18; ++id) dispatcher.Send(id);
  EXPECT_TRUE(dispatcher.session.queue().idle());
  EXPECT_EQ(dispatcher.session.num_dropped(), 2) << "16 of them";
  dispatcher.Calibrate();
  EXPECT_EQ(dispatcher.WorkOffAll().size(), 16U);
}

TEST(DispatcherSession, JobsWaitForAReassembler) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(0);
  dispatcher.session.Receive(ExtractorReady{.extractor = 0, .epoch_us = 1}, 0);
  EXPECT_FALSE(dispatcher.session.CanGive());
  dispatcher.session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs);
  EXPECT_TRUE(dispatcher.session.CanGive());
  EXPECT_EQ(dispatcher.session.GiveNext(0).job->run, kReassemblerEpochUs);
}

TEST(DispatcherSession, ANewReassemblerIsGivenEverythingAgain) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(0);
  dispatcher.session.Receive(ExtractorReady{.extractor = 0, .epoch_us = 1}, 0);
  dispatcher.session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs);
  dispatcher.session.GiveNext(0);
  dispatcher.session.Receive(TileAck{.frame = {0}, .tiles = {0}}, kReassemblerEpochUs);
  EXPECT_FALSE(dispatcher.session.CanGive());
  dispatcher.session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs + 1);
  ASSERT_TRUE(dispatcher.session.CanGive());
  EXPECT_EQ(dispatcher.session.GiveNext(0).job->run, kReassemblerEpochUs + 1);
}

TEST(DispatcherSession, NumbersThatAreLeftOutCountAsDropped) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(5);
  EXPECT_EQ(dispatcher.session.num_dropped(), 0) << "the first frame need not be frame 0";
  dispatcher.Send(8);
  EXPECT_EQ(dispatcher.session.num_dropped(), 2);
  EXPECT_THAT(dispatcher.session.MarkTracked({6}), IsSuccess());
  EXPECT_EQ(dispatcher.session.num_dropped(), 1) << "it was tracked: the camera knew, and left it out";
  EXPECT_THAT(dispatcher.session.MarkTracked({6}), IsSuccess());
  EXPECT_EQ(dispatcher.session.num_dropped(), 1);
}

TEST(DispatcherSession, AFrameFarBeyondAllOthersIsIgnoredAndReported) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(1);
  dispatcher.Send(2'000'000'000);
  EXPECT_EQ(dispatcher.session.TakeReports().size(), 1U);
  EXPECT_EQ(dispatcher.session.num_dropped(), 0);
  dispatcher.Send(2);
  EXPECT_EQ(dispatcher.WorkOffAll(), (Frames{1, 2}));
}

TEST(DispatcherSession, APoseOfAFrameThatNoCameraSentIsRefused) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(1);
  EXPECT_FALSE(dispatcher.session.MarkTracked({2'000'000'000}).has_value());
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{1}) << "it is given out all the same";
}

TEST(DispatcherSession, AnOldFrameIsIgnoredAndReportedIfTheCameraIsTheSame) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(1);
  dispatcher.Send(0);
  EXPECT_EQ(dispatcher.session.TakeReports().size(), 1U) << "is there a second camera?";
  dispatcher.session.Receive(Frame(1), {kCameraEpochUs + 1, kEpochUs + 1, 0}, 0);
  EXPECT_TRUE(dispatcher.session.TakeReports().empty()) << "a camera that was started again repeats itself";
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{1});
}

TEST(DispatcherSession, WhatIsTrackedIsPassedOver) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  EXPECT_THAT(dispatcher.session.MarkTracked({1}), IsSuccess());
  for (int64_t id = 0; id < 4; ++id) dispatcher.SendOld(id);
  EXPECT_EQ(dispatcher.WorkOffAll(), (Frames{2, 3}));
  EXPECT_EQ(dispatcher.session.num_dropped(), 0);
}

TEST(DispatcherSession, AFullQueueDropsTheNewestFrame) {
  Dispatcher dispatcher(2);
  dispatcher.Calibrate();
  for (int64_t id = 0; id < 4; ++id) dispatcher.Send(id);
  EXPECT_EQ(dispatcher.session.num_dropped(), 2);
  EXPECT_EQ(dispatcher.session.TakeReports().size(), 2U);
  EXPECT_EQ(dispatcher.WorkOffAll(), (Frames{0, 1}));
}

TEST(DispatcherSession, WhatTheCameraKeptForANewDispatcherIsAllTaken) {
  Dispatcher dispatcher(2, 4 * 320 * 240);
  dispatcher.Calibrate();
  for (int64_t id = 0; id < 6; ++id) dispatcher.SendOld(id);
  EXPECT_EQ(dispatcher.WorkOffAll(), (Frames{0, 1, 2, 3})) << "up to what a camera's history holds";
}

TEST(DispatcherSession, AFrameUnlikeItsCalibrationIsDropped) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(Frame(0, 300));
  CameraFrame stereo = Frame(1);
  stereo.sensor = SensorType::kStereo;
  dispatcher.Send(stereo);
  dispatcher.Send(2);
  EXPECT_EQ(dispatcher.session.num_dropped(), 2);
  EXPECT_EQ(dispatcher.session.TakeReports().size(), 2U);
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{2});
}

TEST(DispatcherSession, ASecondCalibrationIsReportedAndIgnored) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Calibrate();
  EXPECT_TRUE(dispatcher.session.TakeReports().empty()) << "the same once more";
  CameraCalibration other = kCalibration;
  other.width_px = 300;
  dispatcher.session.Receive(other);
  EXPECT_EQ(dispatcher.session.TakeReports().size(), 1U);
  dispatcher.Send(0);
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{0});
}

TEST(DispatcherSession, TheEndComesWhenAllWorkIsDone) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(0);
  dispatcher.Send(2);
  dispatcher.EndCamera(3);
  EXPECT_FALSE(dispatcher.session.End(0)) << "jobs are open";
  dispatcher.WorkOffAll();
  const auto end = dispatcher.session.End(0);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->num_frames, 3);
  EXPECT_EQ(end->num_dropped, 1);
  EXPECT_FALSE(dispatcher.session.End(0)) << "it is said once";
}

TEST(DispatcherSession, LastFramesThatDoNotComeAreWaitedForAndDropped) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(0);
  dispatcher.EndCamera(4);
  dispatcher.WorkOffAll();
  EXPECT_FALSE(dispatcher.session.End(kTimeoutUs - 1));
  const auto end = dispatcher.session.End(kTimeoutUs);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->num_frames, 1);
  EXPECT_EQ(end->num_dropped, 3);
  EXPECT_EQ(dispatcher.session.num_dropped(), 3);
}

TEST(DispatcherSession, WhoIsMissingIsSaidOnce) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  dispatcher.Send(0);
  std::vector<std::string> reports;
  for (int look = 0; look < 20; ++look) {
    dispatcher.session.Watch(0);
    for (const std::string& report : dispatcher.session.TakeReports()) reports.push_back(report);
  }
  ASSERT_EQ(reports.size(), 2U);
  EXPECT_NE(reports[0].find("tessera-extractor"), std::string::npos);
  EXPECT_NE(reports[1].find("tessera-reassembler"), std::string::npos);
}

}  // namespace
}  // namespace tessera
