// What the dispatcher does with everything that reaches it: frames and their calibration, extractors that are ready,
// acknowledgements, poses and the end of the source in; jobs, reports and the end of its own stream out. No bus, and
// the time is told. Who works on what stands in work_queue.h; here is which frames are taken:
//
//   a frame before its calibration, which travels on another bus, is kept until that comes: 16 of them
//   a frame that is not newer than the newest is ignored; one that is tracked already is passed over
//   numbers that are left out were lost on the way, and count as dropped
//   a frame of another size or sensor than the calibration says is dropped
//   a frame that finds the queue full is dropped, unless it was sent before this dispatcher was started: what the
//   camera keeps is all heard at once, before it is known how far the tracker is
//   live, the newest frame wins: one frame waits at most, and a newer one takes its place
//   a program that is started again and counts from 0 again is continued, in numbers and in time, where that is wanted
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "distribution/overload.h"
#include "distribution/source_watch.h"
#include "distribution/work_queue.h"
#include "geometry/camera_frame.h"
#include "messages/end_of_stream.h"
#include "messages/stage_messages.h"

namespace tessera {

struct DispatcherOptions {
  WorkQueueOptions queue;
  int64_t epoch_us = 0;                 // when this dispatcher was started, wall clock
  int64_t max_kept_bytes = 67'108'864;  // of frames sent before that: what a camera's history holds
  bool newest_wins = false;             // live: a pose that comes late is worth less than the next one
  int64_t give_up_us = 0;               // live: as SourceWatch has it
  bool renumbers = false;               // the source may begin again at frame 0 (bus:)
};

// How a frame came.
struct FrameArrival {
  int64_t camera_epoch_us = 0;  // when the camera that sent it was started
  int64_t publish_us = 0;       // the camera's wall clock when it sent it
  int64_t arrival_us = 0;       // wall clock here
};

class DispatcherSession {
 public:
  explicit DispatcherSession(const DispatcherOptions& options)
      : options_(options), queue_(options.queue), source_watch_(options.give_up_us) {}

  void Receive(const CameraCalibration& calibration);
  void Receive(CameraFrame frame, const FrameArrival& arrival, int64_t now_us);
  void Receive(const ExtractorReady& ready, int64_t now_us);
  // `reassembler_epoch_us`: when the reassembler that has the tiles was started. What it had is lost with it: a new one
  // is given everything again.
  void Receive(const TileAck& ack, int64_t reassembler_epoch_us);
  // This frame, and all before it, have a pose. Fails if the camera can't have sent it.
  Result<> MarkTracked(FrameId frame);
  // The camera has sent its last frame.
  void Receive(const EndOfStream& camera_end, int64_t now_us);
  // To be called five times a second: looks after extractors, and notices who is missing.
  void Watch(int64_t now_us);

  // Whether there is a job, an extractor is free, and it is known which reassembler awaits the answer.
  bool CanGive() const { return reassembler_epoch_us_ && queue_.CanGive(); }
  // Gives the next job to the next free extractor; needs CanGive().
  WorkQueue::Assignment GiveNext(int64_t now_us) { return queue_.GiveNext(now_us); }
  // The end of the dispatcher's stream, once, when all jobs are done and all frames came or won't come any more.
  std::optional<EndOfStream> End(int64_t now_us);
  // One sentence for each thing that went wrong since the last call.
  std::vector<std::string> TakeReports() { return std::exchange(reports_, {}); }

  int64_t num_dropped() const { return num_dropped_; }
  // Live: how long the source has sent nothing, 0 if it sends; and whether the run ends because of that.
  int64_t SilenceUs(int64_t now_us) const { return Watches() ? source_watch_.SilenceUs(now_us) : 0; }
  bool has_given_up() const { return source_watch_.has_given_up(); }
  const WorkQueue& queue() const { return queue_; }

  // Frames that may overtake their calibration.
  static constexpr size_t kMaxFramesBeforeCalibration = 16;
  // After the source's end, a frame that has not come for this long won't come any more.
  static constexpr int64_t kLastFrameTimeoutUs = 5'000'000;
  // So many looks after the first frame, a reassembler that has not been heard of is missed.
  static constexpr int kPatience = 5;

 private:
  struct Arrived {
    CameraFrame frame;
    int64_t captured_us = 0;
    bool is_late = false;  // sent before this dispatcher was started
  };
  bool Watches() const { return options_.newest_wins && !camera_end_; }
  void Report(const std::string& sentence) { reports_.push_back(sentence); }
  void ReportIfAny(const std::optional<std::string>& sentence) {
    if (sentence) Report(*sentence);
  }
  void Continue(CameraFrame& frame, const FrameArrival& arrival, int64_t now_us);
  void NoteGapBefore(FrameId frame);
  void HoldUntilCalibrated(Arrived arrived);
  void Queue(Arrived arrived);
  void MakeRoomForNewest();
  bool MustKeep(const Arrived& arrived, int64_t num_waiting) const;
  bool IsAsCalibrated(const CameraFrame& frame) const;

  const DispatcherOptions options_;
  WorkQueue queue_;
  std::optional<CameraCalibration> calibration_;
  std::vector<Arrived> before_calibration_;
  std::optional<EndOfStream> camera_end_;
  FrameId newest_;                                // highest frame number that came
  FrameId tracked_;                               // this frame, and all before it, have a pose
  std::optional<int64_t> first_camera_epoch_us_;  // of the first camera heard
  std::optional<int64_t> reassembler_epoch_us_;   // of the last one heard
  FrameId gap_begin_, gap_end_;                   // the frames of the last gap: gap_begin_ .. gap_end_ - 1 did not come
  int64_t num_dropped_ = 0;
  Overload overload_;
  FrameId newest_late_;  // the last frame that was sent before this dispatcher was started
  SourceWatch source_watch_;
  int64_t number_offset_ = 0;   // of the source that is continued
  int64_t time_offset_us_ = 0;  // likewise
  int64_t last_camera_epoch_us_ = 0;
  int64_t newest_utime_us_ = 0;     // of newest_
  std::set<FrameId> late_dropped_;  // of those that were, the ones that a newer one replaced
  int64_t last_frame_us_ = 0;       // when the last frame, or the end, came
  int num_unheard_ = 0;             // looks in a row at frames that wait for the reassembler
  bool is_stuck_ = false;           // frames wait, and no extractor is there
  bool has_ended_ = false;
  std::vector<std::string> reports_;
};

}  // namespace tessera
