#include "stages/mapper/mapper_stage.h"

#include <memory>
#include <string>

#include "core/errors.h"

namespace tessera {
namespace {

MapperOptions OptionsFrom(const Settings& settings) {
  MapperOptions options;
  options.creation.max_neighbours = settings.Get<int>("mapper.creation_neighbours");
  options.creation.min_parallax_rad = settings.Get<double>("mapper.min_parallax_rad");
  options.creation.max_hamming = settings.Get<int>("mapper.max_hamming");
  options.fusion.max_neighbours = settings.Get<int>("mapper.fusion_neighbours");
  options.fusion.max_hamming = settings.Get<int>("mapper.max_hamming");
  options.window.min_shared_landmarks = settings.Get<int>("mapper.min_shared_landmarks");
  options.window.max_inner_keyframes = settings.Get<int>("mapper.max_inner_keyframes");
  options.window.max_outer_keyframes = settings.Get<int>("mapper.max_outer_keyframes");
  options.window.is_double = settings.Get<bool>("mapper.double_window");
  options.bundle.is_always_ceres = settings.Get<bool>("mapper.always_ceres");
  options.bundle.max_num_iterations = settings.Get<int>("mapper.bundle_iterations");
  options.culling.redundant_share = settings.Get<double>("mapper.redundant_share");
  if (const std::string problem = options.Check(); !problem.empty()) {
    throw InputError("mapper: " + problem);
  }
  return options;
}

}  // namespace

MapperStage::MapperStage(StageContext& context) : context_(context), mapper_(OptionsFrom(context.settings())) {
  deltas_ = context.Advertise<MapDelta>(kMapDeltaChannel);
  pages_ = context.Advertise<MapSnapshotPage>(kMapSnapshotChannel);
  end_of_stream_ = context.Advertise<EndOfStream>(kEndOfStreamChannel, Publishers::kMany);
  context.Subscribe<KeyframeObservation>(
      kKeyframeChannel, [this](const KeyframeObservation& keyframe, const MessageInfo&) { OnKeyframe(keyframe); });
  context.Subscribe<MapRequest>(kMapRequestChannel,
                                [this](const MapRequest& request, const MessageInfo&) { OnRequest(request); });
  context.Subscribe<EndOfStream>(kEndOfStreamChannel, [this](const EndOfStream& end, const MessageInfo&) {
    if (end.stage == "tracker") {
      tracker_end_ = end;
      FinishIfDone();
    }
  });
}

void MapperStage::OnKeyframe(const KeyframeObservation& keyframe) {
  // Each delta answers one keyframe, and the tracker waits for it: one that is missing can't be passed over.
  if (const int64_t expected = mapper_.map().next_delta(); keyframe.id.value != expected) {
    const std::string name = "keyframe " + std::to_string(keyframe.id.value);
    const std::string sentence =
        expected == 0 ? "the tracker keeps no keyframes before " + name + " any more, so the map can't be built again"
                      : name + " came where " + std::to_string(expected) +
                            " was expected: one was lost beyond repair, or there are two trackers";
    context_.Fail(sentence + "; start the stack again");
    return;
  }
  std::shared_ptr<const MapDelta> delta;
  {
    const StepTimer timer(context_);
    delta = std::make_shared<const MapDelta>(mapper_.Process(keyframe));
  }
  archive_.Add(delta);
  deltas_.Publish(*delta);
  context_.SetValue("keyframes", static_cast<double>(mapper_.map().keyframes().size()));
  context_.SetValue("landmarks", static_cast<double>(mapper_.map().landmarks().size()));
  FinishIfDone();
}

void MapperStage::OnRequest(const MapRequest& request) {
  const MapArchive::Answer answer = archive_.AnswerTo(request, mapper_.map());
  for (const auto& delta : answer.deltas) deltas_.Publish(*delta);
  if (answer.page) pages_.Publish(*answer.page);
}

void MapperStage::FinishIfDone() {
  if (context_.finished() || !tracker_end_ || mapper_.map().next_delta() < tracker_end_->num_values) {
    return;
  }
  end_of_stream_.Publish({.stage = "mapper",
                          .num_frames = tracker_end_->num_frames,
                          .num_dropped = tracker_end_->num_dropped,
                          .num_values = mapper_.map().next_delta()});
  context_.Finish();
}

}  // namespace tessera
