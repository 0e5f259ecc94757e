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
  explicit Dispatcher(int max_queued_frames = 32, int64_t max_kept_bytes = 1'000'000, bool newest_wins = false)
      : session({.queue = {.max_queued_frames = max_queued_frames},
                 .epoch_us = kEpochUs,
                 .max_kept_bytes = max_kept_bytes,
                 .newest_wins = newest_wins}) {}

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

TEST(DispatcherSession, LiveTheNewestFrameTakesThePlaceOfTheOneThatWaits) {
  Dispatcher dispatcher(32, 1'000'000, true);
  dispatcher.Calibrate();
  for (int64_t id = 0; id < 4; ++id) dispatcher.Send(id);
  EXPECT_EQ(dispatcher.session.queue().num_waiting(), 1);
  EXPECT_EQ(dispatcher.session.num_dropped(), 3);
  EXPECT_TRUE(dispatcher.session.TakeReports().empty()) << "one sentence for many of them";
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{3});
  dispatcher.EndCamera(4);
  const auto end = dispatcher.session.End(0);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->num_frames, 4);
  EXPECT_EQ(end->num_dropped, 3);
}

TEST(DispatcherSession, LiveTheFrameBeforeIsTheLastThatWasNotDropped) {
  Dispatcher dispatcher(32, 1'000'000, true);
  dispatcher.Calibrate();
  dispatcher.Send(0);
  dispatcher.WorkOffAll();
  for (const int64_t id : {1, 2}) dispatcher.session.Receive(Frame(id), {kCameraEpochUs, kEpochUs + 1, 0}, 0);
  ASSERT_TRUE(dispatcher.session.CanGive());
  const TileJob job = *dispatcher.session.GiveNext(0).job;
  EXPECT_EQ(job.frame.value, 2);
  EXPECT_EQ(job.previous_frame.value, 0) << "the order in which the reassembler releases frames";
}

TEST(DispatcherSession, WhatTheDispatcherBeforeHadGivenOutDoesNotCountAsDropped) {
  Dispatcher dispatcher(32, 1'000'000, true);
  dispatcher.Calibrate();
  for (int64_t id = 0; id < 4; ++id) dispatcher.SendOld(id);
  EXPECT_EQ(dispatcher.session.num_dropped(), 3);
  dispatcher.session.MarkTracked({0});
  dispatcher.session.MarkTracked({2});
  EXPECT_EQ(dispatcher.session.num_dropped(), 1) << "frame 1 has no pose";
  EXPECT_EQ(dispatcher.WorkOffAll(), Frames{3});
}

TEST(DispatcherSession, AProgramThatIsStartedAgainIsContinued) {
  DispatcherSession session({.epoch_us = kEpochUs, .newest_wins = true, .renumbers = true});
  session.Receive(kCalibration);
  session.Receive(ExtractorReady{.extractor = 0, .epoch_us = 1}, 0);
  session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs);
  const auto send = [&](int64_t id, int64_t camera_epoch_us, int64_t now_us) {
    CameraFrame frame = Frame(id);
    frame.utime_us = 100'000 * id;
    session.Receive(frame, {camera_epoch_us, kEpochUs + now_us, kEpochUs + now_us}, now_us);
    const TileJob job = *session.GiveNext(now_us).job;
    session.Receive(TileAck{.frame = job.frame, .tiles = {job.tile}}, kReassemblerEpochUs);
    session.MarkTracked(job.frame);
    return std::pair(job.frame.value, job.utime_us);
  };
  EXPECT_EQ(send(7, kCameraEpochUs, 0), std::pair(7L, 700'000L));
  EXPECT_EQ(send(0, kCameraEpochUs + 1, 5'000'000), std::pair(8L, 5'700'000L)) << "five seconds later";
  EXPECT_EQ(send(1, kCameraEpochUs + 1, 5'100'000), std::pair(9L, 5'800'000L));
  EXPECT_EQ(session.num_dropped(), 0);
  session.Receive(EndOfStream{.stage = StageKind::kCamera, .num_frames = 2}, 5'200'000);
  const auto end = session.End(5'200'000);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->num_frames, 10);
}

TEST(DispatcherSession, ASilentSourceIsToldAndGivenUp) {
  DispatcherSession session({.epoch_us = kEpochUs, .newest_wins = true, .give_up_us = 10'000'000});
  session.Receive(kCalibration);
  session.Receive(Frame(0), {kCameraEpochUs, kEpochUs + 1, kEpochUs + 2}, 0);
  session.MarkTracked({0});
  session.Watch(9'000'000);
  EXPECT_EQ(session.SilenceUs(9'000'000), 9'000'000);
  EXPECT_EQ(session.TakeReports().size(), 1U);
  EXPECT_FALSE(session.End(9'000'000));
  session.Watch(10'000'000);
  EXPECT_EQ(session.TakeReports().size(), 1U);
  const auto end = session.End(10'000'000);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->num_frames, 1);
}

TEST(DispatcherSession, FramesAreStampedWithTheTimeAtWhichTheyWereTaken) {
  Dispatcher dispatcher;
  dispatcher.Calibrate();
  CameraFrame frame = Frame(0);
  frame.age_us = 300;
  dispatcher.session.Receive(frame, {kCameraEpochUs, kEpochUs + 1000, kEpochUs + 5000}, 0);
  dispatcher.session.Receive(Frame(1), {kCameraEpochUs, kEpochUs - 1, kEpochUs + 9000}, 0);
  dispatcher.session.Receive(ExtractorReady{.extractor = 0, .epoch_us = 1}, 0);
  dispatcher.session.Receive(TileAck{.frame = {0}, .tiles = {}}, kReassemblerEpochUs);
  EXPECT_EQ(dispatcher.session.GiveNext(0).job->captured_us, kEpochUs + 700);
  EXPECT_EQ(dispatcher.session.GiveNext(0).job->captured_us, kEpochUs + 9000) << "a played log's clock is an old one";
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
