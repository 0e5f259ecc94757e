#include "stages/dispatcher/dispatcher_stage.h"

#include <cmath>
#include <string>
#include <utility>

#include "core/time_units.h"
#include "features/tile_packing.h"
#include "messages/tracking_types.h"

namespace tessera {
namespace {

DispatcherOptions OptionsFrom(const StageContext& context) {
  const auto dispatcher = context.settings().Get<DispatcherSettings>();
  const auto camera = context.settings().Get<CameraSettings>();
  const auto features = context.settings().Get<FeaturesSettings>();
  DispatcherOptions options{.epoch_us = context.epoch_us(),
                            .max_kept_bytes = context.settings().Get<StreamTimingSettings>().history_bytes,
                            .newest_wins = dispatcher.newest_wins,
                            .give_up_us = std::llround(1e6 * camera.give_up_s),
                            .renumbers = dispatcher.newest_wins && camera.source.empty()};
  options.queue.grid = ParseTileGrid(dispatcher.tiles);
  options.queue.max_queued_frames = dispatcher.max_queued_frames;
  options.queue.max_frames_in_flight = dispatcher.max_frames_in_flight;
  options.queue.features.num_features = features.num_features;
  options.queue.features.min_score = features.min_score;
  options.queue.features.max_disparity_px = features.max_disparity_px;
  return options;
}

}  // namespace

DispatcherStage::DispatcherStage(StageContext& context)
    : context_(context),
      packs_tiles_(context.settings().Get<DispatcherSettings>().pack_tiles),
      session_(OptionsFrom(context)),
      end_of_stream_(context.Advertise(kEndOfStream)) {
  SubscribeAll();
  const TileGrid grid = ParseTileGrid(context.settings().Get<DispatcherSettings>().tiles);
  context.SetValue("tile_lines", grid.lines);
  context.SetValue("tile_columns", grid.columns);
  context.Every(std::chrono::milliseconds(200), [this] {
    session_.Watch(context_.now_us());
    context_.SetValue("silent_s", SecondsOf(session_.SilenceUs(context_.now_us())));
    context_.SetValue("gave_up", session_.has_given_up() ? 1.0 : 0.0);
    context_.SetValue("extractors", session_.queue().num_extractors());
    context_.SetValue("jobs_given_again", static_cast<double>(session_.queue().num_given_again()));
    context_.SetValue("jobs_wanted_whole", static_cast<double>(session_.queue().num_wanted_whole()));
    GiveWork();  // last: it may end the stream, and STATUS says at once whether the source was given up
  });
}

void DispatcherStage::SubscribeAll() {
  context_.Subscribe(kCalibration, [this](const CameraCalibration& calibration) {
    session_.Receive(calibration);
    GiveWork();
  });
  context_.Subscribe(kCamera, [this](CameraFrame frame, const MessageInfo& info) {
    session_.Receive(std::move(frame), {info.epoch_us, info.publish_us, info.arrival_us}, context_.now_us());
    GiveWork();
  });
  context_.Subscribe(kExtractorReady, [this](const ExtractorReady& ready) {
    session_.Receive(ready, context_.now_us());
    GiveWork();
  });
  context_.Subscribe(kTileAck, [this](const TileAck& ack, const MessageInfo& info) {
    session_.Receive(ack, info.epoch_us);
    GiveWork();
  });
  context_.Subscribe(kPose, [this](const PoseEstimate& pose) {
    Result<> marked = session_.MarkTracked(pose.frame);
    GiveWork();
    return marked;
  });
  context_.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kCamera) session_.Receive(end, context_.now_us());
    GiveWork();
  });
}

// Says what the session has to say after each input.
void DispatcherStage::GiveWork() {
  while (session_.CanGive()) {
    const StepTimer timer(context_);
    const WorkQueue::Assignment job = session_.GiveNext(context_.now_us());
    auto [tile, is_new] = tiles_.try_emplace(job.extractor);
    if (is_new) tile->second = context_.Advertise(TileTopic(job.extractor));
    if (packs_tiles_) {
      tile->second.Publish(PackTile(*job.job));
    } else {
      tile->second.Publish(*job.job);
    }
  }
  const std::optional<EndOfStream> end = session_.End(context_.now_us());
  for (const std::string& report : session_.TakeReports()) context_.ReportError(report);
  context_.SetQueue(session_.queue().num_waiting());
  context_.AddDropped(session_.num_dropped() - num_dropped_told_);
  num_dropped_told_ = session_.num_dropped();
  if (!end) return;
  end_of_stream_.Publish(*end);
  context_.Finish();
}

}  // namespace tessera
