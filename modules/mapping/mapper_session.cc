#include "mapping/mapper_session.h"

#include <stdexcept>
#include <string>
#include <utility>

namespace tessera {

Result<> MapperSessionOptions::Check() const {
  // A loop closer that is started again finds the keyframe in the deltas since the map that it is given.
  if (delays.loop_keyframes < 1 || delays.loop_keyframes >= MapArchive::kDelay) {
    return Failed("a loop must be applied 1 to " + std::to_string(MapArchive::kDelay - 1) + " keyframes later");
  }
  if (delays.adjustment_keyframes < 1 || delays.adjustment_growth < 1) {
    return Failed("a global adjustment must be applied at least one keyframe later");
  }
  return mapper.Check();
}

MapperSession::MapperSession(const MapperSessionOptions& options)
    : options_(options), mapper_(options.mapper), schedule_(options.delays) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
}

MapperSession::State MapperSession::state() const {
  if (has_failed_) return State::kFailed;
  if (has_finished_) return State::kFinished;
  if (!waiting_.empty()) {
    const bool is_ready = !options_.closes_loops || schedule_.CanProcess(waiting_.front().id);
    return is_ready ? State::kReady : State::kAwaitsCorrections;
  }
  if (!tracker_end_ || num_processed_ < tracker_end_->num_values) return State::kAwaitsKeyframe;
  return !may_change() || schedule_.CanFinish(last_loop()) ? State::kEnding : State::kAwaitsCorrections;
}

Result<MapperActions> MapperSession::Load(const MapDelta& snapshot) {
  TESSERA_RETURN_IF_FAILED(mapper_.Load(snapshot));
  archive_.Begin(map());
  places_.Begin(map());
  next_keyframe_ = {map().answered().value + 1};
  schedule_.BeginAt(next_keyframe_);
  MapperActions actions;
  if (map().next_delta() > 0) actions.emplace_back(RemovedInDelta{.delta = map().next_delta() - 1, .links = {}});
  return actions;
}

MapperActions MapperSession::Receive(KeyframeObservation keyframe) {
  if (keyframe.id == next_keyframe_) {
    ++next_keyframe_.value;
    waiting_.push_back(std::move(keyframe));
    return {};
  }
  has_failed_ = true;
  const std::string name = "keyframe " + std::to_string(keyframe.id.value);
  const bool is_first = num_processed_ == 0 && waiting_.empty();
  const std::string sentence =
      is_first ? "the tracker keeps no keyframes before " + name + " any more, so the map can't be built again"
               : name + " came where " + std::to_string(next_keyframe_.value) +
                     " was expected: one was lost beyond repair, or there are two trackers";
  return {Fail{.sentence = sentence + "; start the stack again"}};
}

MapperActions MapperSession::Receive(const LoopResult& result) {
  schedule_.Receive(result);
  return {};
}

MapperActions MapperSession::Receive(const GlobalAdjustment& adjustment) {
  schedule_.Receive(adjustment);
  return {};
}

MapperActions MapperSession::Receive(const MapRequest& request) {
  MapArchive::Answer answer = archive_.AnswerTo(request);
  MapperActions actions;
  for (auto& delta : answer.deltas) actions.emplace_back(std::move(delta));
  for (auto& page : answer.pages) actions.emplace_back(std::move(page));
  return actions;
}

MapperActions MapperSession::Receive(const EndOfStream& tracker_end) {
  tracker_end_ = tracker_end;
  return {};
}

MapperActions MapperSession::Advance(const std::optional<MapperStep>& taken) {
  switch (state()) {
    case State::kReady:
      return Process(taken);
    case State::kEnding:
      return End();
    default:
      return {};
  }
}

MapperActions MapperSession::Process(const std::optional<MapperStep>& taken) {
  const KeyframeObservation keyframe = std::move(waiting_.front());
  waiting_.pop_front();
  ++num_processed_;
  const DueCorrections due = options_.closes_loops ? schedule_.Take(keyframe.id) : DueCorrections{};
  if (taken && taken->is_repeatable) {
    if (const Result<> repeated = mapper_.Repeat(keyframe, *taken); !repeated) {
      has_failed_ = true;
      return {Fail{.sentence = "its journal does not fit its input: " + repeated.error().sentence}};
    }
    return Publish(taken->delta);
  }
  MapDelta delta = mapper_.Process(keyframe, due);
  MapperActions actions;
  actions.emplace_back(mapper_.LastStep(delta));
  for (MapperAction& action : Publish(std::move(delta))) actions.push_back(std::move(action));
  return actions;
}

// What is left of loops and adjustments corrects the map, which may lose keyframes and ask for a last adjustment; then
// it is final.
MapperActions MapperSession::End() {
  if (may_change()) {
    std::optional<MapDelta> delta = mapper_.Finish(schedule_.TakeAll(last_loop()));
    if (delta) return Publish(std::move(*delta));
  }
  has_finished_ = true;
  return {EndOfStream{.stage = StageKind::kMapper,
                      .num_frames = tracker_end_->num_frames,
                      .num_dropped = tracker_end_->num_dropped,
                      .num_values = map().next_delta()},
          Finish{}};
}

MapperActions MapperSession::Publish(MapDelta delta) {
  if (delta.asks_adjustment) schedule_.Ask(delta.answers, delta.number);
  auto shared = std::make_shared<const MapDelta>(std::move(delta));
  archive_.Add(shared, schedule_.asked_delta());
  MapperActions actions;
  actions.emplace_back(shared);
  actions.emplace_back(places_.Update(*shared, map()));
  return actions;
}

}  // namespace tessera
