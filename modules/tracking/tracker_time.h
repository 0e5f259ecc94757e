// Which changes of the map, and which answer of the loop closer, each frame is tracked with: three policies.
//
//   LogicalTime  Frame f sees exactly the deltas that answer keyframes of frames <= f - D, and the answer to its own
//                question. What comes early is held back, what is missing is waited for: the same input gives the same
//                result. Of frames that come slowly, D is fewer: at two images a second, three frames are a turn
//                around a corner, and nothing of the map that the last one has seen is left in view.
//   LiveTime     A frame sees what is there, but for the answer to one of several keyframes of one frame, which comes
//                with the others: mono's first points belong to two. It never waits; an answer serves the frame that is
//                next when it comes.
//   ReplayTime   Each frame sees what it saw in a live run that was recorded.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/ids.h"
#include "map/map.h"
#include "messages/loop_types.h"
#include "messages/recorded_steps.h"

namespace tessera {

class TrackerTime {
 public:
  using Delta = std::shared_ptr<const MapDelta>;

  virtual ~TrackerTime() = default;

  // The next delta came in (MapFollower puts them in order). One that is held already changes nothing.
  void Receive(Delta delta);
  // A snapshot was applied, in place of all deltas up to its number; those after it will be received (again).
  void SkipTo(const MapDelta& snapshot);
  // A keyframe went out while frame `at` was tracked, which came `interval_us` after the one before (0: there was
  // none). Keyframes must come in the order of their ids.
  virtual void KeyframeSent(KeyframeId id, FrameId at, int64_t interval_us);
  // Whether all deltas that `frame` must see are there.
  virtual bool HasDeltas(FrameId frame) const = 0;
  // Takes out the deltas that `frame` sees and no frame before it saw, in order. HasDeltas(frame) must hold.
  virtual std::vector<Delta> TakeDeltas(FrameId frame);

  // Whether `frame` may ask where it was taken.
  virtual bool MayAsk(FrameId frame) const = 0;
  // `frame` asks. Returns whether the question is to be sent.
  virtual bool Ask(FrameId frame);
  void Receive(const RelocalizationAnswer& answer);
  // Whether `frame` must wait for the answer to its question.
  virtual bool AwaitsAnswer(FrameId frame) const = 0;
  // The answer that `frame` is tracked with, valid until the next call of a member; nullptr: none.
  virtual const RelocalizationAnswer* TakeAnswer(FrameId frame) = 0;
  // A question was sent, and no answer came yet.
  bool has_open_question() const { return asked_.valid() && !IsAnswered(); }

  // Whether what frames see depends on what happened to be there (PoseEstimate::is_live).
  virtual bool is_live() const = 0;

 protected:
  // Whether `frame` sees `delta`.
  virtual bool IsDue(const MapDelta& delta, FrameId frame) const = 0;
  bool IsAnswered() const { return answer_ && answer_->frame == asked_; }

  int64_t next_delta_ = 0;  // number of the one that Receive() expects
  KeyframeId answered_;     // by the last delta received
  KeyframeId last_sent_;
  FrameId asked_;                               // the frame of the last question; invalid: none is of interest
  std::optional<RelocalizationAnswer> answer_;  // the last that came

 private:
  std::deque<Delta> held_;
};

class LogicalTime : public TrackerTime {
 public:
  // D = `map_delay_frames` >= 1, but no more frames than come in kMaxMapDelay_us, if that is one at least. `may_ask`:
  // frames may ask where they were taken, each once.
  explicit LogicalTime(int64_t map_delay_frames, bool may_ask = true)
      : map_delay_frames_(map_delay_frames), may_ask_(may_ask) {}

  void KeyframeSent(KeyframeId id, FrameId at, int64_t interval_us) override;
  bool HasDeltas(FrameId frame) const override { return answered_ >= LastDue(frame); }
  std::vector<Delta> TakeDeltas(FrameId frame) override;
  bool MayAsk(FrameId frame) const override { return may_ask_ && asked_ != frame; }
  bool AwaitsAnswer(FrameId frame) const override { return asked_ == frame && !IsAnswered(); }
  const RelocalizationAnswer* TakeAnswer(FrameId frame) override;
  bool is_live() const override { return false; }

  static constexpr int64_t kMaxMapDelay_us = 500'000;

 private:
  struct Sent {
    KeyframeId id;
    FrameId due;  // the first frame that sees its answer
  };
  bool IsDue(const MapDelta& delta, FrameId frame) const override { return delta.answers <= LastDue(frame); }
  // The last keyframe whose answer `frame` sees.
  KeyframeId LastDue(FrameId frame) const;

  const int64_t map_delay_frames_;
  const bool may_ask_;
  std::deque<Sent> sent_;  // keyframes whose answers no frame had to see yet
  KeyframeId past_due_;    // the last keyframe before those
};

class LiveTime : public TrackerTime {
 public:
  // `may_ask`: a frame may ask where it was taken, if no question is open.
  explicit LiveTime(bool may_ask = true) : may_ask_(may_ask) {}

  void KeyframeSent(KeyframeId id, FrameId at, int64_t interval_us) override;
  bool HasDeltas(FrameId) const override { return true; }
  bool MayAsk(FrameId) const override { return may_ask_ && !asked_.valid(); }
  bool AwaitsAnswer(FrameId) const override { return false; }
  const RelocalizationAnswer* TakeAnswer(FrameId frame) override;
  bool is_live() const override { return true; }

 private:
  bool IsDue(const MapDelta& delta, FrameId frame) const override;

  const bool may_ask_;
  FrameId last_at_;           // the frame that made the last keyframe
  KeyframeId first_of_last_;  // the first keyframe that it made
};

// Sends no questions: the answers that were used stand in the log.
class ReplayTime : public TrackerTime {
 public:
  explicit ReplayTime(RecordedSteps recorded) : recorded_(std::move(recorded)) {}

  // A frame without a step takes no deltas; where fewer are made than in the recording, all of them will do.
  bool HasDeltas(FrameId frame) const override;
  bool MayAsk(FrameId frame) const override { return recorded_.relocalizations.contains(frame); }
  bool Ask(FrameId) override { return false; }
  bool AwaitsAnswer(FrameId) const override { return false; }
  const RelocalizationAnswer* TakeAnswer(FrameId frame) override;
  bool is_live() const override { return true; }

 private:
  bool IsDue(const MapDelta& delta, FrameId frame) const override;

  const RecordedSteps recorded_;
};

struct TrackerTimeOptions {
  bool is_live = false;
  int64_t map_delay_frames = 1;  // D of LogicalTime
  bool may_ask = true;           // frames may ask where they were taken
};

// The policy that the options ask for; of a run that is replayed, `recorded`, the one that repeats it: only a live one
// needs its steps, logical time comes to the same ones again.
std::unique_ptr<TrackerTime> MakeTrackerTime(const TrackerTimeOptions& options, std::optional<RecordedSteps> recorded);

}  // namespace tessera
