#include "stages/mapper/mapper_stage.h"

#include <memory>
#include <utility>

#include "core/errors.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

// Many followers that build the map anew at once are answered; a flood of requests does not keep it from its work.
constexpr double kAnswersPerSecond = 300;
constexpr double kAnswersAtOnce = 50;
// Who has not heard an answer asks again after three times as long (map_subscription.cc).
constexpr int64_t kAnswerHolds_us = 100000;

MapperSessionOptions OptionsFrom(const MapperSettings& settings) {
  MapperSessionOptions options;
  options.mapper.window.max_inner_keyframes = settings.max_inner_keyframes;
  options.mapper.window.max_outer_keyframes = settings.max_outer_keyframes;
  options.mapper.polishes = settings.polish;
  options.mapper.refines_focal = settings.refine_focal;
  options.delays.loop_keyframes = settings.loop_delay_keyframes;
  options.delays.adjustment_keyframes = settings.adjustment_delay_keyframes;
  options.closes_loops = settings.close_loops;
  return options;
}

}  // namespace

MapperStage::MapperStage(StageContext& context)
    : context_(context.KeepJournal({kKeyframe, kLoopResult, kGlobalAdjustment, kMapRequest, kEndOfStream},
                                   {kMapDelta, kMapSnapshot, kRemovedKeyframes, kEndOfStream})),
      answering_(kAnswersPerSecond, kAnswersAtOnce),
      session_(OptionsFrom(context.settings().Get<MapperSettings>())),
      deltas_(context.Advertise(kMapDelta)),
      pages_(context.Advertise(kMapSnapshot)),
      removed_(context.Advertise(kRemovedKeyframes)),
      end_of_stream_(context.Advertise(kEndOfStream)) {
  if (const auto path = context.settings().Get<MapperSettings>().load_map; !path.empty()) {
    const auto loaded = session_.Load(ReadMapFile(path));
    if (!loaded) throw InputError("map file " + path + " is damaged: " + loaded.error().sentence);
    Do(*loaded);
  }
  Receive(kKeyframe);
  Receive(kLoopResult);
  Receive(kGlobalAdjustment);
  context.Subscribe(kMapRequest, [this](const MapRequest& request, const MessageInfo& info) {
    // By the time of arrival, which is the same when the journal is replayed.
    if (IsAnswered(request, info.arrival_us) || !answering_.Take(1, info.arrival_us)) return;
    answered_ = {request, info.arrival_us};
    Do(session_.Receive(request));
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage != StageKind::kTracker) return;
    Do(session_.Receive(end));
    Advance();
  });
}

// All followers hear the pages that one of them asked for.
bool MapperStage::IsAnswered(const MapRequest& request, int64_t arrival_us) const {
  const MapRequest& answered = answered_.request;
  return request.snapshot >= 0 && request.snapshot == answered.snapshot && request.page == answered.page &&
         arrival_us - answered_.arrival_us < kAnswerHolds_us;
}

template <class Value>
void MapperStage::Receive(const Topic<Value>& topic) {
  context_.Subscribe(topic, [this](Value value) {
    Do(session_.Receive(std::move(value)));
    Advance();
  });
}

void MapperStage::Advance() {
  while (session_.state() == MapperSession::State::kReady) {
    const StepTimer timer(context_);
    Do(session_.Advance(context_.Remembered<MapperStep>()));
  }
  context_.SetQueue(static_cast<int64_t>(session_.num_waiting()));
  while (session_.state() == MapperSession::State::kEnding) Do(session_.Advance());
  const Map& map = session_.map();
  context_.SetValue("keyframes", static_cast<double>(map.keyframes().size()));
  context_.SetValue("landmarks", static_cast<double>(map.landmarks().size()));
  context_.SetValue("loops", static_cast<double>(map.closed_loops().size()));
  context_.SetValue("scale_mendings", static_cast<double>(session_.num_scale_mendings()));
  context_.SetValue("focal_error", session_.lens_refiner().error());
  context_.SetValue("lens_radial", session_.map().lens().radial);
  context_.SetValue("focal_doubt", session_.lens_refiner().doubt());
  const RightShift& right = session_.map().lens().right_shift;
  context_.SetValue("right_shift_px", right.center_px);
  context_.SetValue("right_shift_across_px", right.across_px);
  context_.SetValue("right_shift_down_px", right.down_px);
  context_.SetValue("right_shift_bend_px", right.bend_px);
  context_.SetValue("right_shift_doubt_px", session_.lens_refiner().right_shift_doubt_px());
}

void MapperStage::Do(const MapperActions& actions) {
  const Overloaded perform{
      [this](const std::shared_ptr<const MapDelta>& delta) { deltas_.Publish(*delta); },
      [this](const RemovedInDelta& removed) { removed_.Publish(removed); },
      [this](const MapSnapshotPage& page) { pages_.Publish(page); },
      [this](const EndOfStream& end) { end_of_stream_.Publish(end); },
      [this](const MapperStep& step) { context_.Remember(step); },
      [this](const Fail& fail) { context_.Fail(fail.sentence, fail.is_user_error ? 2 : 1); },
      [this](const Finish&) { context_.Finish(); },
  };
  for (const MapperAction& action : actions) std::visit(perform, action);
}

}  // namespace tessera
