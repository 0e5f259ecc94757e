#include "datasets/camera_session.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/errors.h"

namespace tessera {
namespace {

using State = CameraSession::State;
constexpr int64_t kFrameUs = 100'000;

// Frames 0 .. num_frames - 1, of which each second one has a true pose.
class FakeSource : public FrameSource {
 public:
  FakeSource(int64_t num_frames, bool is_live, int64_t damaged) : live_(is_live), damaged_(damaged), end_(num_frames) {
    for (int64_t frame = 0; frame < num_frames; frame += 2) truths_.push_back({.frame = {frame}});
  }
  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override { return end_; }
  const std::vector<GroundTruthPose>& ground_truth() const override { return truths_; }
  std::optional<CameraFrame> Next() override {
    if (next_ == damaged_) throw InputError("frame is damaged");
    if (next_ >= end_) return std::nullopt;
    CameraFrame frame;
    frame.id = {next_};
    frame.utime_us = kFrameUs * next_++;
    return frame;
  }
  void SkipTo(FrameId frame) override { next_ = std::max(next_, frame.value); }
  bool is_live() const override { return live_; }
  const std::vector<std::string>& notes() const override { return notes_; }

 private:
  CameraCalibration calibration_;
  std::vector<GroundTruthPose> truths_;
  std::vector<std::string> notes_;
  bool live_;
  int64_t damaged_;
  int64_t next_ = 0, end_;
};

CameraSession Recorded(int64_t num_frames, int window = 3, int64_t damaged = -1) {
  return {std::make_unique<FakeSource>(num_frames, false, damaged), {.lockstep_window = window}, 10, 0};
}

// Sends all that may go at time 0.
std::vector<int64_t> SendAll(CameraSession& session) {
  std::vector<int64_t> frames;
  for (State state = session.Look(0); state == State::kMustRead || state == State::kReady; state = session.Look(0)) {
    if (state == State::kMustRead) {
      session.Read();
    } else {
      frames.push_back(session.Send(0).frame.id.value);
    }
  }
  return frames;
}

using Frames = std::vector<int64_t>;

TEST(CameraSession, LockstepSendsAsFastAsPosesComeBack) {
  CameraSession session = Recorded(5);
  EXPECT_EQ(SendAll(session), (Frames{0, 1, 2}));
  EXPECT_EQ(session.Look(0), State::kWaits) << "frame 3 has been read";
  session.MarkTracked({0}, 0, 0);
  EXPECT_EQ(SendAll(session), Frames{3});
  session.MarkTracked({3}, 3 * kFrameUs, 0);
  EXPECT_EQ(SendAll(session), Frames{4});
  EXPECT_EQ(session.Look(0), State::kAtEnd);
  EXPECT_EQ(session.num_sent(), 5);
}

TEST(CameraSession, TruePosesGoWithTheirFrames) {
  CameraSession session = Recorded(4, 10);
  session.Read();
  EXPECT_EQ(session.Send(0).truths.size(), 1U);
  session.Read();
  EXPECT_TRUE(session.Send(0).truths.empty());
  session.Read();
  EXPECT_EQ(session.Send(0).truths.front().frame, FrameId{2});
}

TEST(CameraSession, TheStreamEndsOnceBehindItsLastFrame) {
  CameraSession session = Recorded(3, 10);
  SendAll(session);
  const auto ending = session.End();
  ASSERT_TRUE(ending);
  EXPECT_EQ(ending->end.stage, StageKind::kCamera);
  EXPECT_EQ(ending->end.num_frames, 3);
  EXPECT_FALSE(session.End());
  EXPECT_EQ(session.Look(0), State::kEnded);
}

TEST(CameraSession, ToldToStopItEndsWhereItIs) {
  CameraSession session = Recorded(9, 2);
  SendAll(session);
  EXPECT_EQ(session.End()->end.num_frames, 2);
}

TEST(CameraSession, ADamagedImageBreaksTheStreamOff) {
  CameraSession session = Recorded(9, 10, 2);
  EXPECT_THROW(SendAll(session), InputError);
  EXPECT_EQ(session.Look(0), State::kEnded);
  EXPECT_FALSE(session.End()) << "a stream that broke off has not ended";
}

TEST(CameraSession, ARecordedSourceContinuesBehindWhatIsTracked) {
  CameraSession session = Recorded(9, 2);
  session.MarkTracked({4}, 4 * kFrameUs, 0);
  EXPECT_EQ(SendAll(session), (Frames{5, 6}));
}

TEST(CameraSession, WhatIsTrackedToItsEndEndsThere) {
  CameraSession session = Recorded(5, 2);
  session.MarkTracked({4}, 4 * kFrameUs, 0);
  EXPECT_TRUE(SendAll(session).empty());
  EXPECT_EQ(session.End()->end.num_frames, 5);
}

TEST(CameraSession, ALiveSourceContinuesWithHigherNumbers) {
  CameraSession session(std::make_unique<FakeSource>(3, true, -1), {.kind = PacerOptions::Kind::kFree}, 10, 0);
  session.MarkTracked({100}, 100 * kFrameUs, 0);
  EXPECT_EQ(SendAll(session), (Frames{111, 112, 113})) << "behind all that may be on its way";
}

TEST(CameraSession, LockstepAsksForHelpWhenNoPoseComes) {
  CameraSession session = Recorded(9, 2);
  EXPECT_FALSE(session.Watch(2 * CameraSession::kNoPoseUs)) << "nothing was sent";
  SendAll(session);
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs));
  EXPECT_TRUE(session.Watch(CameraSession::kNoPoseUs + 1));
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs + 2)) << "once";
  session.MarkTracked({0}, 0, CameraSession::kNoPoseUs + 3);
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs + 4));
  EXPECT_TRUE(session.Watch(2 * CameraSession::kNoPoseUs + 4)) << "and again";
}

}  // namespace
}  // namespace tessera
