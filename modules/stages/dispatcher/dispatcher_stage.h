// Wiring of the dispatcher: frames in, jobs out to extractors. The rules are in work_queue.h.
#pragma once

#include <map>
#include <optional>
#include <set>

#include "distribution/work_queue.h"
#include "geometry/camera_frame.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class DispatcherStage {
 public:
  explicit DispatcherStage(StageContext& context);

 private:
  void OnFrame(const CameraFrame& frame, const MessageInfo& info);
  void OnCalibration(const CameraCalibration& calibration);
  void OnPose(FrameId frame);
  void NoteGapBefore(FrameId frame);
  void OnAck(const TileAck& ack, const MessageInfo& info);
  // A frame that came, until it is queued.
  struct Arrived {
    CameraFrame frame;
    int64_t arrival_us = 0;
    bool is_late = false;  // sent before this dispatcher was started
  };
  void QueueFrame(Arrived arrived);
  bool MustKeep(const Arrived& arrived, int64_t num_waiting) const;
  void GiveWork();
  void Watch();
  void FinishIfDone();

  StageContext& context_;
  WorkQueue queue_;
  std::map<int, Publisher<TileJob>> tiles_;  // by extractor
  Publisher<EndOfStream> end_of_stream_;
  std::optional<CameraCalibration> calibration_;
  std::vector<Arrived> before_calibration_;  // frames that overtook it
  std::optional<EndOfStream> source_end_;
  FrameId newest_;                                // highest frame number that came
  FrameId tracked_;                               // this frame, and all before it, have a pose
  std::optional<int64_t> first_camera_epoch_us_;  // of the first camera heard
  std::optional<int64_t> reassembler_epoch_us_;   // of the last one heard
  FrameId gap_begin_, gap_end_;                   // the frames of the last gap: gap_begin_ .. gap_end_ - 1 did not come
  int64_t num_dropped_ = 0;
  int64_t last_activity_us_ = 0;  // when the last frame came
  bool warned_no_extractor_ = false;
  int num_unheard_ = 0;  // looks in a row at frames that wait for the reassembler
};

}  // namespace tessera
