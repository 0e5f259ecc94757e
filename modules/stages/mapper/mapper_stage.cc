#include "stages/mapper/mapper_stage.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/errors.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

MapperOptions OptionsFrom(const Settings& settings) {
  MapperOptions options;
  options.creation.max_neighbors = settings.Get<int>("mapper.creation_neighbours");
  options.creation.min_parallax_rad = settings.Get<double>("mapper.min_parallax_rad");
  options.creation.max_hamming = settings.Get<int>("mapper.max_hamming");
  options.fusion.max_neighbors = settings.Get<int>("mapper.fusion_neighbours");
  options.fusion.max_hamming = settings.Get<int>("mapper.max_hamming");
  options.window.min_shared_landmarks = settings.Get<int>("mapper.min_shared_landmarks");
  options.window.max_inner_keyframes = settings.Get<int>("mapper.max_inner_keyframes");
  options.window.max_outer_keyframes = settings.Get<int>("mapper.max_outer_keyframes");
  options.window.is_double = settings.Get<bool>("mapper.double_window");
  options.bundle.is_always_ceres = settings.Get<bool>("mapper.always_ceres");
  options.bundle.max_num_iterations = settings.Get<int>("mapper.bundle_iterations");
  options.keyframe_culling.redundant_share = settings.Get<double>("mapper.redundant_share");
  if (const std::string problem = options.Check(); !problem.empty()) {
    throw InputError("mapper: " + problem);
  }
  return options;
}

CorrectionDelays DelaysFrom(const Settings& settings) {
  const CorrectionDelays delays{settings.Get<int>("mapper.loop_delay_keyframes"),
                                settings.Get<int>("mapper.adjustment_delay_keyframes"),
                                settings.Get<int>("mapper.adjustment_delay_growth")};
  if (delays.loop_keyframes < 1 || delays.loop_keyframes >= MapArchive::kSnapshotInterval) {
    throw InputError("mapper.loop_delay_keyframes must be between 1 and " +
                     std::to_string(MapArchive::kSnapshotInterval - 1));
  }
  if (delays.adjustment_keyframes < 1 || delays.adjustment_growth < 1) {
    throw InputError("mapper.adjustment_delay_keyframes and mapper.adjustment_delay_growth must be at least 1");
  }
  return delays;
}

}  // namespace

MapperStage::MapperStage(StageContext& context)
    : context_(context),
      mapper_(OptionsFrom(context.settings())),
      closes_loops_(context.settings().Get<bool>("mapper.close_loops")),
      schedule_(DelaysFrom(context.settings())) {
  if (const auto path = context.settings().Get<std::string>("mapper.load_map"); !path.empty()) Load(path);
  deltas_ = context.Advertise(kMapDelta);
  removed_ = context.Advertise(kRemovedKeyframes);
  if (mapper_.map().next_delta() > 0) removed_.Publish({.delta = mapper_.map().next_delta() - 1, .links = {}});
  pages_ = context.Advertise(kMapSnapshot);
  end_of_stream_ = context.Advertise(kEndOfStream);
  context.Subscribe(kKeyframe, [this](const KeyframeObservation& keyframe) { OnKeyframe(keyframe); });
  context.Subscribe(kLoopResult, [this](const LoopResult& result) {
    schedule_.Receive(result);
    ProcessWaiting();
  });
  context.Subscribe(kGlobalAdjustment, [this](const GlobalAdjustment& adjustment) {
    schedule_.Receive(adjustment);
    ProcessWaiting();
  });
  context.Subscribe(kMapRequest, [this](const MapRequest& request) { OnRequest(request); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kTracker) {
      tracker_end_ = end;
      ProcessWaiting();
    }
  });
}

// The map goes on where it ended: with the next number of keyframes.
void MapperStage::Load(const std::string& path) {
  ThrowIfFailed<InputError>(mapper_.Load(ReadMapFile(path)), "map file " + path + " is damaged: ");
  archive_.Begin(mapper_.map());
  places_.Begin(mapper_.map());
  next_keyframe_ = {mapper_.map().answered().value + 1};
  schedule_.BeginAt(next_keyframe_);
}

void MapperStage::OnKeyframe(const KeyframeObservation& keyframe) {
  // Each delta answers one keyframe, and the tracker waits for it: one that is missing can't be passed over.
  if (keyframe.id != next_keyframe_) {
    const std::string name = "keyframe " + std::to_string(keyframe.id.value);
    const std::string sentence =
        num_processed_ == 0 && waiting_.empty()
            ? "the tracker keeps no keyframes before " + name + " any more, so the map can't be built again"
            : name + " came where " + std::to_string(next_keyframe_.value) +
                  " was expected: one was lost beyond repair, or there are two trackers";
    context_.Fail(sentence + "; start the stack again");
    return;
  }
  ++next_keyframe_.value;
  waiting_.push_back(keyframe);
  ProcessWaiting();
}

void MapperStage::ProcessWaiting() {
  while (!waiting_.empty() && (!closes_loops_ || schedule_.CanProcess(waiting_.front().id))) {
    const StepTimer timer(context_);
    const KeyframeObservation& keyframe = waiting_.front();
    Publish(mapper_.Process(keyframe, closes_loops_ ? schedule_.Take(keyframe.id) : DueCorrections{}));
    waiting_.pop_front();
    ++num_processed_;
  }
  context_.SetQueue(static_cast<int64_t>(waiting_.size()));
  FinishIfDone();
}

void MapperStage::Publish(MapDelta&& delta) {
  if (delta.asks_adjustment) schedule_.Ask(delta.answers, delta.number);
  const auto shared = std::make_shared<const MapDelta>(std::move(delta));
  archive_.Add(shared, mapper_.map(), schedule_.asked_delta());
  deltas_.Publish(*shared);
  removed_.Publish(places_.Update(*shared, mapper_.map()));
  context_.SetValue("keyframes", static_cast<double>(mapper_.map().keyframes().size()));
  context_.SetValue("landmarks", static_cast<double>(mapper_.map().landmarks().size()));
  context_.SetValue("loops", static_cast<double>(mapper_.map().closed_loops().size()));
}

void MapperStage::OnRequest(const MapRequest& request) {
  const MapArchive::Answer answer = archive_.AnswerTo(request, mapper_.map());
  for (const auto& delta : answer.deltas) deltas_.Publish(*delta);
  if (answer.page) pages_.Publish(*answer.page);
}

// When the last keyframe is in the map, all loops and adjustments on their way are waited for, and bend it once more.
void MapperStage::FinishIfDone() {
  if (context_.finished() || !tracker_end_ || num_processed_ < tracker_end_->num_values) return;
  const KeyframeId last{next_keyframe_.value - 1};
  while (closes_loops_ && num_processed_ > 0) {
    if (!schedule_.CanFinish(last)) return;
    std::optional<MapDelta> delta = mapper_.Finish(schedule_.TakeAll(last));
    if (!delta) break;
    Publish(std::move(*delta));
  }
  end_of_stream_.Publish({.stage = StageKind::kMapper,
                          .num_frames = tracker_end_->num_frames,
                          .num_dropped = tracker_end_->num_dropped,
                          .num_values = mapper_.map().next_delta()});
  context_.Finish();
}

}  // namespace tessera
