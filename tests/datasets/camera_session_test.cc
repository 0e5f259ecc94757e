#include "datasets/camera_session.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "support/matchers.h"

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
  // As wide as the number of the frame; those of odd frames have become unreadable.
  ColorReader TakeColor() override {
    return [frame = static_cast<int>(next_ - 1)] {
      if (frame % 2 == 1) throw InputError("the file is gone");
      return ColorImage(frame, 1);
    };
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
  return {std::make_unique<FakeSource>(num_frames, false, damaged), {{.lockstep_window = window}, true, 10}, 0};
}

// All values of one type among the actions.
template <class Value>
std::vector<Value> AllOf(const CameraActions& actions) {
  std::vector<Value> values;
  for (const CameraAction& action : actions) {
    if (const auto* value = std::get_if<Value>(&action)) values.push_back(*value);
  }
  return values;
}

// Reads and sends all that may go at time 0.
CameraActions AdvanceAll(CameraSession& session) {
  CameraActions all;
  for (State state = session.Look(0); state == State::kMustRead || state == State::kReady; state = session.Look(0)) {
    for (CameraAction& action : session.Advance(0)) all.push_back(std::move(action));
  }
  return all;
}

std::vector<int64_t> SendAll(CameraSession& session) {
  std::vector<int64_t> frames;
  for (const CameraFrame& frame : AllOf<CameraFrame>(AdvanceAll(session))) frames.push_back(frame.id.value);
  return frames;
}

// The end of the stream, which must be there.
EndOfStream EndOf(const CameraActions& actions) {
  const std::vector<EndOfStream> ends = AllOf<EndOfStream>(actions);
  EXPECT_EQ(ends.size(), 1U);
  return ends.empty() ? EndOfStream{} : ends.front();
}

using Frames = std::vector<int64_t>;

TEST(CameraSession, LockstepSendsAsFastAsPosesComeBack) {
  CameraSession session = Recorded(5);
  EXPECT_EQ(SendAll(session), (Frames{0, 1, 2}));
  EXPECT_EQ(session.Look(0), State::kWaits) << "frame 3 has been read";
  EXPECT_THAT(session.MarkTracked({0}, 0, 0), IsSuccess());
  EXPECT_EQ(SendAll(session), Frames{3});
  EXPECT_THAT(session.MarkTracked({3}, 3 * kFrameUs, 0), IsSuccess());
  EXPECT_EQ(SendAll(session), Frames{4});
  EXPECT_EQ(session.Look(0), State::kAtEnd);
  EXPECT_EQ(session.num_sent(), 5);
}

TEST(CameraSession, LooksAgainWhenATimedFrameIsDueAndOftenAtALiveSource) {
  const auto next_look = [](bool is_live, PacerOptions::Kind kind) {
    CameraSession session(std::make_unique<FakeSource>(3, is_live, -1), {{.kind = kind}, true, 10}, 0);
    for (int i = 0; i < 3; ++i) session.Advance(50);  // reads and sends frame 0, and reads frame 1
    return session.NextLookUs(50);
  };
  EXPECT_EQ(next_look(false, PacerOptions::Kind::kLockstep), std::nullopt) << "a pose wakes it";
  EXPECT_EQ(next_look(false, PacerOptions::Kind::kFree), std::nullopt);
  EXPECT_EQ(next_look(false, PacerOptions::Kind::kTimed), 50 + kFrameUs);
  EXPECT_EQ(next_look(true, PacerOptions::Kind::kLockstep), 50 + CameraSession::kLookAtLiveUs)
      << "nothing says that a frame has come";
}

TEST(CameraSession, TruePosesGoBeforeTheirFrames) {
  CameraSession session = Recorded(3, 10);
  const CameraActions actions = AdvanceAll(session);
  ASSERT_EQ(actions.size(), 5U);
  EXPECT_EQ(std::get<GroundTruthPose>(actions[0]).frame, FrameId{0});
  EXPECT_EQ(std::get<CameraFrame>(actions[1]).id, FrameId{0});
  EXPECT_EQ(std::get<CameraFrame>(actions[2]).id, FrameId{1}) << "has none";
  EXPECT_EQ(std::get<GroundTruthPose>(actions[3]).frame, FrameId{2});
  EXPECT_EQ(std::get<CameraFrame>(actions[4]).id, FrameId{2});
}

TEST(CameraSession, TheStreamEndsOnceBehindItsLastFrame) {
  CameraSession session = Recorded(3, 10);
  SendAll(session);
  const CameraActions actions = session.Advance(0);
  EXPECT_EQ(EndOf(actions).stage, StageKind::kCamera);
  EXPECT_EQ(EndOf(actions).num_frames, 3);
  EXPECT_EQ(EndOf(actions).num_values, 0) << "the first frame that it sent";
  EXPECT_EQ(AllOf<Finish>(actions).size(), 1U);
  EXPECT_EQ(session.Look(0), State::kEnded);
  EXPECT_TRUE(session.Advance(0).empty());
  EXPECT_TRUE(session.End().empty());
}

TEST(CameraSession, APoseOfAFrameThatWasNeverSentIsRefused) {
  CameraSession session = Recorded(9, 2);
  SendAll(session);
  EXPECT_FALSE(session.MarkTracked({2'000'000'000}, 0, 0).has_value());
  EXPECT_THAT(session.MarkTracked({1}, kFrameUs, 0), IsSuccess());
  EXPECT_EQ(session.Look(0), State::kReady) << "it continues where it was";
}

TEST(CameraSession, ToldToStopItEndsWhereItIs) {
  CameraSession session = Recorded(9, 2);
  SendAll(session);
  EXPECT_EQ(EndOf(session.End()).num_frames, 2);
}

TEST(CameraSession, ADamagedImageBreaksTheStreamOff) {
  CameraSession session = Recorded(9, 10, 2);
  const std::vector<Fail> fails = AllOf<Fail>(AdvanceAll(session));
  ASSERT_EQ(fails.size(), 1U);
  EXPECT_TRUE(fails[0].is_user_error);
  EXPECT_EQ(session.Look(0), State::kEnded);
  EXPECT_TRUE(session.End().empty()) << "a stream that broke off has not ended";
}

TEST(CameraSession, WithoutFollowersNoPoseIsWaitedFor) {
  CameraSession session(std::make_unique<FakeSource>(5, false, -1), {{.lockstep_window = 2}, false, 10}, 0);
  EXPECT_EQ(SendAll(session).size(), 5U);
}

TEST(CameraSession, ARecordedSourceContinuesBehindWhatIsTracked) {
  CameraSession session = Recorded(9, 2);
  EXPECT_THAT(session.MarkTracked({4}, 4 * kFrameUs, 0), IsSuccess());
  EXPECT_EQ(SendAll(session), (Frames{5, 6}));
}

TEST(CameraSession, WhatIsTrackedToItsEndEndsThere) {
  CameraSession session = Recorded(5, 2);
  EXPECT_THAT(session.MarkTracked({4}, 4 * kFrameUs, 0), IsSuccess());
  EXPECT_TRUE(SendAll(session).empty());
  EXPECT_EQ(EndOf(session.End()).num_frames, 5);
}

TEST(CameraSession, ALiveSourceContinuesWithHigherNumbers) {
  CameraSession session(std::make_unique<FakeSource>(3, true, -1), {{.lockstep_window = 2}, true, 10}, 0);
  EXPECT_THAT(session.MarkTracked({100}, 100 * kFrameUs, 0), IsSuccess());
  EXPECT_EQ(SendAll(session), (Frames{111, 112, 113})) << "at its own pace, behind all that may be on its way";
}

TEST(CameraSession, LockstepAsksForHelpWhenNoPoseComes) {
  CameraSession session = Recorded(9, 2);
  EXPECT_FALSE(session.Watch(2 * CameraSession::kNoPoseUs)) << "nothing was sent";
  SendAll(session);
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs));
  EXPECT_TRUE(session.Watch(CameraSession::kNoPoseUs + 1));
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs + 2)) << "once";
  EXPECT_THAT(session.MarkTracked({0}, 0, CameraSession::kNoPoseUs + 3), IsSuccess());
  EXPECT_FALSE(session.Watch(CameraSession::kNoPoseUs + 4));
  EXPECT_TRUE(session.Watch(2 * CameraSession::kNoPoseUs + 4)) << "and again";
}

TEST(CameraSession, TellsTheColorsOfKeyframes) {
  CameraSession session(std::make_unique<FakeSource>(10, false, -1),
                        {{.lockstep_window = 6}, true, 10, /*with_color=*/true}, 0);
  EXPECT_TRUE(AllOf<ColorFrame>(AdvanceAll(session)).empty()) << "it is not known yet which frames become keyframes";
  ASSERT_THAT(session.MarkTracked({2}, 2 * kFrameUs, 0), IsSuccess());
  const std::vector<ColorFrame> colors = AllOf<ColorFrame>(session.TellColor({2}, 2 * kFrameUs));
  ASSERT_EQ(colors.size(), 1U);
  EXPECT_EQ(colors[0], (ColorFrame{.id = {2}, .utime_us = 2 * kFrameUs, .image = ColorImage(2, 1)}));
  ASSERT_THAT(session.MarkTracked({4}, 4 * kFrameUs, 0), IsSuccess());
  for (const int64_t frame : {2, 5}) {  // was tracked before; unreadable
    const std::vector<ColorFrame> none = AllOf<ColorFrame>(session.TellColor({frame}, 0));
    ASSERT_EQ(none.size(), 1U);
    EXPECT_TRUE(none[0].image.empty());
  }
}

// A camera that was started again and hears first that frames 0 .. 8 are tracked, of which 2, 5 and 8 are keyframes.
CameraSession StartedAgain(SourceOpener open_again) {
  CameraSession session(std::make_unique<FakeSource>(20, false, -1),
                        {{.lockstep_window = 3}, true, 10, /*with_color=*/true}, 0, std::move(open_again));
  for (int64_t frame = 0; frame < 9; ++frame) {
    EXPECT_THAT(session.MarkTracked({frame}, frame * kFrameUs, 0), IsSuccess());
    const bool is_keyframe = frame % 3 == 2;
    if (is_keyframe) {
      EXPECT_TRUE(session.TellColor({frame}, frame * kFrameUs).empty()) << "it is read later";
    }
  }
  return session;
}

TEST(CameraSession, StartedAgainItReadsTheColorsOfKeyframesBeforeOnceMore) {
  std::vector<int64_t> opened;
  CameraSession session = StartedAgain([&](FrameId first) {
    opened.push_back(first.value);
    return std::make_unique<FakeSource>(20, false, -1);
  });
  for (const auto& [frame, width] : {std::pair(2, 2), {5, 0}, {8, 8}}) {  // odd ones are unreadable
    const std::vector<ColorFrame> colors = AllOf<ColorFrame>(session.TellMissedColor());
    ASSERT_EQ(colors.size(), 1U);
    const ColorImage image = width > 0 ? ColorImage(width, 1) : ColorImage();
    EXPECT_EQ(colors[0], (ColorFrame{.id = {frame}, .utime_us = frame * kFrameUs, .image = image}));
  }
  EXPECT_TRUE(session.TellMissedColor().empty());
  EXPECT_EQ(opened, Frames{2});
  EXPECT_EQ(SendAll(session), (Frames{9, 10, 11})) << "its own frames go as if there had been nothing";
}

TEST(CameraSession, ASourceThatIsGoneHasNoColorsAnyMore) {
  CameraSession session = StartedAgain([](FrameId) -> std::unique_ptr<FrameSource> { throw InputError("gone"); });
  for (const int64_t frame : {2, 5, 8}) {
    const std::vector<ColorFrame> colors = AllOf<ColorFrame>(session.TellMissedColor());
    ASSERT_EQ(colors.size(), 1U);
    EXPECT_EQ(colors[0], (ColorFrame{.id = {frame}, .utime_us = frame * kFrameUs}));
  }
}

TEST(CameraSession, OfManyKeyframesBeforeTheNewestAreReadAgain) {
  CameraSession session(std::make_unique<FakeSource>(900, false, -1), {{}, true, 10, /*with_color=*/true}, 0,
                        [](FrameId) { return std::make_unique<FakeSource>(900, false, -1); });
  constexpr auto kMax = static_cast<int64_t>(CameraSession::kMaxColors);
  for (int64_t frame = 0; frame < 2 * kMax + 4; frame += 2) {
    ASSERT_THAT(session.MarkTracked({frame}, frame * kFrameUs, 0), IsSuccess());
    const std::vector<ColorFrame> dropped = AllOf<ColorFrame>(session.TellColor({frame}, frame * kFrameUs));
    ASSERT_EQ(dropped.size(), frame < 2 * kMax ? 0U : 1U);
    if (!dropped.empty()) {
      EXPECT_EQ(dropped[0].id.value, frame - 2 * kMax);
    }
  }
  EXPECT_EQ(AllOf<ColorFrame>(session.TellMissedColor()).at(0).id, FrameId{4});
}

TEST(CameraSession, WhereNobodyTracksAllFramesHaveTheirColorInFrontOfThem) {
  CameraSession session(std::make_unique<FakeSource>(3, false, -1), {{}, false, 0, /*with_color=*/true}, 0);
  std::vector<std::string> sent;
  for (const CameraAction& action : AdvanceAll(session)) {
    if (const auto* frame = std::get_if<CameraFrame>(&action))
      sent.push_back("frame " + std::to_string(frame->id.value));
    if (const auto* color = std::get_if<ColorFrame>(&action))
      sent.push_back("color " + std::to_string(color->id.value));
  }
  EXPECT_EQ(sent, (std::vector<std::string>{"frame 0", "frame 1", "color 2", "frame 2"}))
      << "empty images are left out";
}

TEST(CameraSession, ColorsThatNobodyWantsAreNotTold) {
  CameraSession session = Recorded(3);
  AdvanceAll(session);
  ASSERT_THAT(session.MarkTracked({2}, 2 * kFrameUs, 0), IsSuccess());
  EXPECT_TRUE(session.TellColor({2}, 2 * kFrameUs).empty());
}

}  // namespace
}  // namespace tessera
