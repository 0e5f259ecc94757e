#include "distribution/dispatcher_session.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr int64_t kMaxFramesLost = 100'000;  // on the way, at a time: an hour's

std::string SizeText(int width_px, int height_px) { return std::to_string(width_px) + "x" + std::to_string(height_px); }

}  // namespace

void DispatcherSession::Receive(const CameraCalibration& calibration) {
  if (calibration_) {
    if (*calibration_ != calibration) {
      Report("the calibration changed within a stream; the new one is ignored: restart the stack for another camera");
    }
    return;
  }
  calibration_ = calibration;
  for (Arrived& arrived : before_calibration_) Queue(std::move(arrived));
  before_calibration_.clear();
}

// A program that was started again counts from 0 again: it is continued behind what came before, by the time that has
// passed here.
void DispatcherSession::Continue(CameraFrame& frame, const FrameArrival& arrival, int64_t now_us) {
  if (!options_.renumbers) return;
  const bool is_other = newest_.valid() && arrival.camera_epoch_us != last_camera_epoch_us_;
  last_camera_epoch_us_ = arrival.camera_epoch_us;
  if (is_other && frame.id.value + number_offset_ <= newest_.value) {
    number_offset_ = newest_.value + 1 - frame.id.value;
    first_camera_epoch_us_ = arrival.camera_epoch_us;
    Report("the program that sends the frames was started again; the run continues with its frames");
  }
  if (is_other && frame.utime_us + time_offset_us_ <= newest_utime_us_) {
    time_offset_us_ = newest_utime_us_ + std::max<int64_t>(1, now_us - last_frame_us_) - frame.utime_us;
  }
  frame.id.value += number_offset_;
  frame.utime_us += time_offset_us_;
}

void DispatcherSession::Receive(CameraFrame frame, const FrameArrival& arrival, int64_t now_us) {
  Continue(frame, arrival, now_us);
  if (Watches()) ReportIfAny(source_watch_.NoteFrame(now_us));
  last_frame_us_ = now_us;
  if (!first_camera_epoch_us_) first_camera_epoch_us_ = arrival.camera_epoch_us;
  if (frame.id <= newest_) {
    // A camera that was started again repeats what is not tracked yet.
    if (arrival.camera_epoch_us == *first_camera_epoch_us_) {
      Report("frame " + std::to_string(frame.id.value) + " came after frame " + std::to_string(newest_.value) +
             " and is ignored: is there a second camera?");
    }
    return;
  }
  if (newest_.valid() && frame.id.value - newest_.value > kMaxFramesLost) {
    reports_.push_back("frame " + std::to_string(frame.id.value) + " came after frame " +
                       std::to_string(newest_.value) + " and is ignored: so many can't have been lost on the way");
    return;
  }
  NoteGapBefore(frame.id);
  newest_ = frame.id;
  newest_utime_us_ = frame.utime_us;
  overload_.NoteArrival(now_us);
  const bool is_late = arrival.publish_us < options_.epoch_us;
  if (is_late) newest_late_ = frame.id;
  // A log player repeats the wall clock of its recording.
  const int64_t captured_us = is_late ? arrival.arrival_us : arrival.publish_us - frame.age_us;
  Arrived arrived{std::move(frame), captured_us, is_late};
  if (calibration_) {
    Queue(std::move(arrived));
  } else {
    HoldUntilCalibrated(std::move(arrived));
  }
}

// Frames that got lost on the way from the camera, and that nobody could repair.
void DispatcherSession::NoteGapBefore(FrameId frame) {
  const FrameId known = std::max(newest_, tracked_);
  if (!newest_.valid() || frame.value <= known.value + 1) return;
  gap_begin_ = {known.value + 1};
  gap_end_ = frame;
  num_dropped_ += gap_end_.value - gap_begin_.value;
}

void DispatcherSession::HoldUntilCalibrated(Arrived arrived) {
  const size_t num_waiting = before_calibration_.size();
  if (num_waiting < kMaxFramesBeforeCalibration || MustKeep(arrived, static_cast<int64_t>(num_waiting))) {
    before_calibration_.push_back(std::move(arrived));
  } else {
    ++num_dropped_;
  }
}

void DispatcherSession::Queue(Arrived arrived) {
  const FrameId id = arrived.frame.id;
  if (id <= tracked_) {
    queue_.SkipFrame(id);
    return;
  }
  if (!IsAsCalibrated(arrived.frame)) {
    ++num_dropped_;
    Report("frame " + std::to_string(id.value) + " is " +
           SizeText(arrived.frame.left.width, arrived.frame.left.height) + " px, but the calibration says " +
           SizeText(calibration_->width_px, calibration_->height_px) + ": the frame is dropped");
    return;
  }
  if (options_.newest_wins) MakeRoomForNewest();
  const bool must_keep = MustKeep(arrived, queue_.num_waiting());
  if (!queue_.AddFrame(std::move(arrived.frame), *calibration_, arrived.captured_us, must_keep)) {
    ++num_dropped_;
    Report("the pipeline is slower than the source: frame " + std::to_string(id.value) +
           " is dropped (more extractors, fewer features or a slower pace help)");
  }
}

void DispatcherSession::MakeRoomForNewest() {
  const std::optional<FrameId> dropped = queue_.DropNewestWaiting();
  if (!dropped) return;
  ++num_dropped_;
  overload_.NoteDrop();
  if (*dropped <= newest_late_) late_dropped_.insert(*dropped);
}

// A log player, too, sends what is old.
bool DispatcherSession::MustKeep(const Arrived& arrived, int64_t num_waiting) const {
  const CameraFrame& frame = arrived.frame;
  const size_t num_bytes = frame.left.pixels.size() + frame.right.pixels.size() + 2 * frame.depth.pixels.size();
  return arrived.is_late && num_waiting * static_cast<int64_t>(num_bytes) < options_.max_kept_bytes;
}

bool DispatcherSession::IsAsCalibrated(const CameraFrame& frame) const {
  return frame.left.width == calibration_->width_px && frame.left.height == calibration_->height_px &&
         frame.sensor == calibration_->sensor;
}

void DispatcherSession::Receive(const ExtractorReady& ready, int64_t now_us) {
  queue_.HearExtractor(ready.extractor, ready.epoch_us, now_us, ready.num_robots);
}

void DispatcherSession::Receive(const TileAck& ack, int64_t reassembler_epoch_us) {
  if (reassembler_epoch_us_ && *reassembler_epoch_us_ != reassembler_epoch_us) queue_.GiveAllAgain();
  reassembler_epoch_us_ = reassembler_epoch_us;
  queue_.SetRun(reassembler_epoch_us);
  if (ack.wants_all) {
    queue_.WantAll(ack.frame, ack.tiles);
  } else {
    queue_.Acknowledge(ack.frame, ack.tiles);
  }
  if (!ack.lowest_priority.empty()) queue_.SetLowestPriority(ack.lowest_priority);
}

Result<> DispatcherSession::MarkTracked(FrameId frame) {
  if (newest_.valid() && frame.value > std::max(newest_, tracked_).value + kMaxFramesLost) {
    return Failed("its frame " + std::to_string(frame.value) + " is far beyond " + std::to_string(newest_.value) +
                  ", the last one that the camera sent");
  }
  // Where camera and dispatcher were started again, the camera may be the first to know what is tracked, and leave it
  // out.
  if (frame > tracked_ && frame >= gap_begin_ && frame < gap_end_) --num_dropped_;
  // One that the dispatcher before this one gave out. Poses come in order: those before it get none any more.
  if (late_dropped_.contains(frame)) --num_dropped_;
  late_dropped_.erase(late_dropped_.begin(), late_dropped_.upper_bound(frame));
  tracked_ = std::max(tracked_, frame);
  queue_.MarkTracked(frame);
  return {};
}

void DispatcherSession::Receive(const EndOfStream& camera_end, int64_t now_us) {
  if (camera_end_) return;
  camera_end_ = camera_end;
  last_frame_us_ = now_us;
}

void DispatcherSession::Watch(int64_t now_us) {
  ReportIfAny(overload_.Look(now_us));
  if (Watches()) ReportIfAny(source_watch_.Look(now_us));
  queue_.CheckExtractors(now_us);
  const bool was_stuck = is_stuck_;
  is_stuck_ = queue_.num_extractors() == 0 && !queue_.idle();
  if (is_stuck_ && !was_stuck) {
    Report("no extractor answers and frames are waiting: start one (tessera-extractor --id 0)");
  }
  const bool is_unheard = !reassembler_epoch_us_ && !queue_.idle();
  num_unheard_ = is_unheard ? num_unheard_ + 1 : 0;
  if (num_unheard_ == kPatience) {
    Report("frames are waiting for the reassembler to say that it is there: start tessera-reassembler");
  }
}

std::optional<EndOfStream> DispatcherSession::End(int64_t now_us) {
  if (has_ended_ || !(camera_end_ || has_given_up()) || !queue_.idle()) return std::nullopt;
  const EndOfStream camera_end = camera_end_.value_or(EndOfStream{.num_frames = newest_.value + 1});
  const int64_t num_missing = std::max<int64_t>(0, camera_end.num_frames + number_offset_ - (newest_.value + 1));
  if (num_missing > 0 && now_us - last_frame_us_ < kLastFrameTimeoutUs) return std::nullopt;
  has_ended_ = true;
  num_dropped_ += num_missing;
  return EndOfStream{.stage = StageKind::kDispatcher,
                     .num_frames = queue_.last_frame().value + 1,
                     .num_dropped = camera_end.num_dropped + num_dropped_};
}

}  // namespace tessera
