// What the camera does with its source and with the poses that come back: which frame is sent, with which number, and
// when. Poses in, actions out. No bus, and the time is told.
//
//   kMustRead  Advance() reads the next frame ahead, so that decoding it delays nobody
//   kWaits     the frame that was read may not go yet (pacer.h), or a live source has none
//   kReady     Advance() sends it, behind the true poses up to it
//   kAtEnd     the source has no more frames: Advance() ends the stream
//   kEnded     the stream has ended, or broke off at a damaged image and gets no end
//
// A frame that becomes a keyframe, as POSE tells, is sent once more in color, if that is wanted. Where nobody tells
// which frames do, all of them are, each before its frame.
//
// A camera that was started again learns from POSE what is tracked, and continues behind it: what was on its way is
// sent once more. A recorded source keeps its numbers; a live one gets higher ones (renumbering.h). Which colors of
// keyframes arrived in its earlier life nobody tells it: it reads the newest ones again, and tells them once more.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/result.h"
#include "core/session_actions.h"
#include "datasets/frame_source.h"
#include "datasets/pacer.h"
#include "datasets/renumbering.h"
#include "messages/end_of_stream.h"

namespace tessera {

struct CameraSessionOptions {
  PacerOptions pace;           // of a source that can be delayed
  bool is_followed = true;     // false: nobody tracks the frames and answers with poses, so nothing is waited for
  int64_t num_on_the_way = 0;  // frames that the dispatcher can have taken, beyond the last one tracked
  bool with_color = false;
};

// Values are to be published.
using CameraAction = std::variant<GroundTruthPose, ColorFrame, CameraFrame, EndOfStream, Fail, Finish>;
using CameraActions = std::vector<CameraAction>;

// Opens a recorded source once more, to be read from this frame on. Throws InputError if it can't.
using SourceOpener = std::function<std::unique_ptr<FrameSource>(FrameId first)>;

class CameraSession {
 public:
  enum class State { kMustRead, kWaits, kReady, kAtEnd, kEnded };

  // `open_again`: null if the source can't be opened twice.
  CameraSession(std::unique_ptr<FrameSource> source, const CameraSessionOptions& options, int64_t now_us,
                SourceOpener open_again = nullptr);

  const FrameSource& source() const { return *source_; }
  // This frame, taken at `utime_us`, and all before it, have a pose. Fails if it can't have been sent.
  Result<> MarkTracked(FrameId frame, int64_t utime_us, int64_t now_us);
  // What tells the color of this frame, which became a keyframe: an empty image if there is none. Nothing if colors are
  // not wanted, or if it has to be read again: TellMissedColor() does that. Frames ascend.
  CameraActions TellColor(FrameId frame, int64_t utime_us);
  // The color of one keyframe of an earlier life; nothing if there is none left. It decodes an image.
  CameraActions TellMissedColor();
  std::vector<std::string> TakeEvents() { return source_->TakeEvents(); }
  // The state now; passes over what is tracked.
  State Look(int64_t now_us);
  // When the state may have changed without anything received, if it may: a timed frame is due then; nothing says that
  // a frame of a live source has come.
  std::optional<int64_t> NextLookUs(int64_t now_us) const;
  // Takes the step of the state that Look() just told; none where the camera waits or has ended.
  CameraActions Advance(int64_t now_us);
  // Ends the stream, here if need be; nothing if it has ended.
  CameraActions End();
  // One sentence when lockstep has waited for a pose for too long, once each time. To be called once a second.
  std::optional<std::string> Watch(int64_t now_us);

  int num_ahead() const { return pacer_.num_ahead(); }
  int64_t num_sent() const { return num_sent_; }

  // Small against the time between two images of any camera.
  static constexpr int64_t kLookAtLiveUs = 2'000;
  // Without a pose for this long, lockstep asks for help: the slowest pipeline tracks a frame in less.
  static constexpr int64_t kNoPoseUs = 10'000'000;
  // Frames whose colors are kept until their poses come, and keyframes whose colors are read again; of more, the
  // oldest are dropped.
  static constexpr size_t kMaxColors = 64;
  // No pipeline has so many frames in it.
  static constexpr int64_t kMaxFramesAhead = 10'000;

 private:
  void PassOverTracked();
  CameraActions Read();
  CameraActions Send(int64_t now_us);
  void KeepColor(CameraActions& actions);
  ColorImage ReadColorAgain(FrameId frame);
  CameraActions TruthsUpTo(FrameId frame);

  const bool is_followed_;
  const bool with_color_;
  std::unique_ptr<FrameSource> source_;
  Pacer pacer_;
  Renumbering renumbering_;                // of a live source
  std::optional<CameraFrame> next_;        // read and not yet sent
  ColorReader next_color_;                 // of next_
  std::map<FrameId, ColorReader> colors_;  // of all frames that were sent and have no pose yet; null: gray
  std::deque<ColorFrame> missed_;          // keyframes whose colors are to be read again
  const SourceOpener open_again_;
  std::unique_ptr<FrameSource> again_;  // the source, while missed_ are read from it
  bool is_exhausted_ = false;
  size_t num_truths_sent_ = 0;
  int64_t num_sent_ = 0;
  FrameId first_sent_, last_sent_;
  FrameId tracked_;  // this frame, and all before it, have a pose
  int64_t tracked_utime_us_ = 0;
  int64_t last_progress_us_;  // when a frame was last sent or a pose last came
  bool has_ended_ = false;
  bool is_stuck_ = false;
};

}  // namespace tessera
