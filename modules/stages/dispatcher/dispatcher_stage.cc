#include "stages/dispatcher/dispatcher_stage.h"

#include <algorithm>
#include <utility>

#include "core/errors.h"
#include "messages/stage_messages.h"
#include "messages/tracking_types.h"

namespace tessera {
namespace {

// Frames that may overtake their CALIBRATION message, which travels on another bus.
constexpr size_t kMaxFramesBeforeCalibration = 16;
// After the source's end, a frame that has not come for this long won't come any more.
constexpr int64_t kLastFrameTimeoutUs = 5'000'000;
// So many looks after the first frame, a reassembler that has not been heard of is missed.
constexpr int kPatience = 5;

WorkQueueOptions OptionsFrom(const Settings& settings) {
  WorkQueueOptions options;
  options.grid = ParseTileGrid(settings.Get<std::string>("dispatcher.tiles"));
  options.coarse_levels_from = settings.Get<int>("dispatcher.coarse_levels_from");
  options.max_queued_frames = settings.Get<int>("dispatcher.max_queued_frames");
  options.max_frames_in_flight = settings.Get<int>("dispatcher.max_frames_in_flight");
  options.jobs_per_extractor = settings.Get<int>("dispatcher.jobs_per_extractor");
  options.late_us = 1000LL * settings.Get<int>("dispatcher.late_ms");
  options.silent_us = 1000LL * settings.Get<int>("dispatcher.silent_ms");
  options.features.num_features = settings.Get<int>("features.num_features");
  options.features.num_levels = settings.Get<int>("features.num_levels");
  options.features.min_score = settings.Get<int>("features.min_score");
  options.features.max_disparity_px = settings.Get<int>("features.max_disparity_px");
  if (const std::string problem = options.Check(); !problem.empty()) {
    throw InputError(problem);
  }
  return options;
}

}  // namespace

DispatcherStage::DispatcherStage(StageContext& context) : context_(context), queue_(OptionsFrom(context.settings())) {
  end_of_stream_ = context.Advertise(kEndOfStream);
  context.Subscribe(kCalibration, [this](const CameraCalibration& calibration) { OnCalibration(calibration); });
  context.Subscribe(kCamera, [this](const CameraFrame& frame, const MessageInfo& info) { OnFrame(frame, info); });
  context.Subscribe(kExtractorReady, [this](const ExtractorReady& ready) {
    queue_.HearExtractor(ready.extractor, ready.epoch_us, context_.now_us(), ready.num_robots);
    GiveWork();
  });
  context.Subscribe(kTileAck, [this](const TileAck& ack, const MessageInfo& info) { OnAck(ack, info); });
  context.Subscribe(kPose, [this](const PoseEstimate& pose) { OnPose(pose.frame); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kCamera && !source_end_) {
      source_end_ = end;
      last_activity_us_ = context_.now_us();
      FinishIfDone();
    }
  });
  context.Every(std::chrono::milliseconds(200), [this] { Watch(); });
}

void DispatcherStage::OnCalibration(const CameraCalibration& calibration) {
  if (calibration_ && *calibration_ != calibration) {
    context_.ReportError(
        "the calibration changed within a stream; the new one is ignored: restart the stack for another camera");
    return;
  }
  if (calibration_) {
    return;
  }
  calibration_ = calibration;
  for (Arrived& arrived : before_calibration_) {
    QueueFrame(std::move(arrived));
  }
  before_calibration_.clear();
  GiveWork();
}

void DispatcherStage::OnFrame(const CameraFrame& frame, const MessageInfo& info) {
  last_activity_us_ = context_.now_us();
  if (!first_camera_epoch_us_) first_camera_epoch_us_ = info.epoch_us;
  if (frame.id <= newest_) {
    // A camera that was started again repeats what is not tracked yet.
    if (info.epoch_us == *first_camera_epoch_us_) {
      context_.ReportError("frame " + std::to_string(frame.id.value) + " came after frame " +
                           std::to_string(newest_.value) + " and is ignored: is there a second camera?");
    }
    return;
  }
  NoteGapBefore(frame.id);
  newest_ = frame.id;
  Arrived arrived{frame, info.arrival_us, info.publish_us < context_.epoch_us()};
  if (!calibration_) {
    const size_t num_waiting = before_calibration_.size();
    if (num_waiting < kMaxFramesBeforeCalibration || MustKeep(arrived, static_cast<int64_t>(num_waiting))) {
      before_calibration_.push_back(std::move(arrived));
    } else {
      ++num_dropped_;
      context_.AddDropped(1);
    }
    return;
  }
  QueueFrame(std::move(arrived));
  GiveWork();
}

// Frames that got lost on the way from the camera, and that nobody could repair.
void DispatcherStage::NoteGapBefore(FrameId frame) {
  const FrameId known = std::max(newest_, tracked_);
  if (!newest_.valid() || frame.value <= known.value + 1) return;
  gap_begin_ = {known.value + 1};
  gap_end_ = frame;
  num_dropped_ += gap_end_.value - gap_begin_.value;
  context_.AddDropped(gap_end_.value - gap_begin_.value);
}

void DispatcherStage::OnPose(FrameId frame) {
  // Where camera and dispatcher were started again, the camera may be the first to know what is tracked, and leave it
  // out.
  if (frame > tracked_ && frame >= gap_begin_ && frame < gap_end_) {
    --num_dropped_;
    context_.AddDropped(-1);
  }
  tracked_ = std::max(tracked_, frame);
  queue_.MarkTracked(frame);
  GiveWork();
}

// A dispatcher that was started again hears all that the camera still has, before it knows what of that is tracked: not
// more than a history holds. (Old too is what a log player sends.)
bool DispatcherStage::MustKeep(const Arrived& arrived, int64_t num_waiting) const {
  const CameraFrame& frame = arrived.frame;
  const size_t num_bytes = frame.left.pixels.size() + frame.right.pixels.size() + 2 * frame.depth.pixels.size();
  const int64_t history_bytes = context_.settings().Get<int>("stream.history_bytes");
  return arrived.is_late && num_waiting * static_cast<int64_t>(num_bytes) < history_bytes;
}

// What a reassembler has is lost with it: its successor begins with nothing.
void DispatcherStage::OnAck(const TileAck& ack, const MessageInfo& info) {
  if (reassembler_epoch_us_ && *reassembler_epoch_us_ != info.epoch_us) {
    queue_.GiveAllAgain();
  }
  reassembler_epoch_us_ = info.epoch_us;
  queue_.SetRun(info.epoch_us);
  queue_.Acknowledge(ack.frame, ack.tiles);
  GiveWork();
}

void DispatcherStage::QueueFrame(Arrived arrived) {
  const CameraFrame& frame = arrived.frame;
  if (frame.id <= tracked_) {
    queue_.SkipFrame(frame.id);
    return;
  }
  if (frame.left.width != calibration_->width_px || frame.left.height != calibration_->height_px ||
      frame.sensor != calibration_->sensor) {
    ++num_dropped_;
    context_.AddDropped(1);
    context_.ReportError("frame " + std::to_string(frame.id.value) + " is " + std::to_string(frame.left.width) + "x" +
                         std::to_string(frame.left.height) + " px, but the calibration says " +
                         std::to_string(calibration_->width_px) + "x" + std::to_string(calibration_->height_px) +
                         ": the frame is dropped");
    return;
  }
  const FrameId id = frame.id;
  const bool must_keep = MustKeep(arrived, queue_.num_waiting());
  if (!queue_.AddFrame(std::move(arrived.frame), *calibration_, arrived.arrival_us, must_keep)) {
    ++num_dropped_;
    context_.AddDropped(1);
    context_.ReportError("the pipeline is slower than the source: frame " + std::to_string(id.value) +
                         " is dropped (more extractors, fewer features or a slower pace help)");
  }
}

// Gives out jobs while there are any and somebody is free, once it is known which reassembler awaits the answers.
void DispatcherStage::GiveWork() {
  while (reassembler_epoch_us_ && queue_.CanGive()) {
    const StepTimer timer(context_);
    const auto [extractor, job] = queue_.GiveNext(context_.now_us());
    if (!tiles_.contains(extractor)) {
      tiles_[extractor] = context_.Advertise(TileTopic(extractor));
    }
    tiles_[extractor].Publish(*job);
  }
  context_.SetQueue(queue_.num_waiting());
  FinishIfDone();
}

void DispatcherStage::Watch() {
  queue_.CheckExtractors(context_.now_us());
  GiveWork();
  context_.SetValue("extractors", queue_.num_extractors());
  context_.SetValue("jobs_given_again", static_cast<double>(queue_.num_given_again()));
  const bool stuck = queue_.num_extractors() == 0 && !queue_.idle();
  if (stuck && !warned_no_extractor_) {
    context_.ReportError("no extractor answers and frames are waiting: start one (tessera-extractor --id 0)");
  }
  warned_no_extractor_ = stuck;
  const bool is_unheard = !reassembler_epoch_us_ && !queue_.idle();
  num_unheard_ = is_unheard ? num_unheard_ + 1 : 0;
  if (num_unheard_ == kPatience) {
    context_.ReportError("frames are waiting for the reassembler to say that it is there: start tessera-reassembler");
  }
}

void DispatcherStage::FinishIfDone() {
  if (context_.finished() || !source_end_ || !queue_.idle()) {
    return;
  }
  const bool all_came = newest_.value + 1 >= source_end_->num_frames;
  if (!all_came && context_.now_us() - last_activity_us_ < kLastFrameTimeoutUs) {
    return;
  }
  const int64_t num_missing = std::max<int64_t>(0, source_end_->num_frames - (newest_.value + 1));
  context_.AddDropped(num_missing);
  end_of_stream_.Publish({.stage = StageKind::kDispatcher,
                          .num_frames = queue_.last_frame().value + 1,
                          .num_dropped = source_end_->num_dropped + num_dropped_ + num_missing});
  context_.Finish();
}

}  // namespace tessera
