#include "stages/loop_closer/loop_closer_stage.h"

#include <string>
#include <variant>

#include "core/errors.h"
#include "core/project_file.h"
#include "core/session_actions.h"

namespace tessera {
namespace {

LoopCloserSessionOptions OptionsFrom(const Settings& settings) {
  const auto loop_closer = settings.Get<LoopCloserSettings>();
  const auto mapper = settings.Get<MapperSettings>();
  LoopCloserSessionOptions options;
  options.loop_closer.verification.min_seen = loop_closer.min_seen;
  options.loop_closer.verification.min_coverage = loop_closer.min_coverage;
  options.loop_closer.relocalization.min_seen = loop_closer.min_relocalized;
  options.loop_closer.relocalization.min_coverage = loop_closer.min_coverage;
  options.closes_loops = mapper.close_loops;
  options.loop_delay_keyframes = mapper.loop_delay_keyframes;
  return options;
}

std::shared_ptr<const Vocabulary> VocabularyFrom(const Settings& settings) {
  const std::string path = settings.Get<LoopCloserSettings>().vocabulary;
  if (!path.empty()) return Vocabulary::Load(path);
  const auto shipped = FindProjectFile("config/vocabulary.tvoc");
  if (!shipped)
    throw InputError("no folder above this program holds config/vocabulary.tvoc; set loop_closer.vocabulary");
  return Vocabulary::Load(*shipped);
}

}  // namespace

LoopCloserStage::LoopCloserStage(StageContext& context)
    : context_(context.KeepJournal({kMapDelta, kMapSnapshot, kRelocalizationRequest, kEndOfStream},
                                   {kLoopResult, kRelocalization})),
      session_(VocabularyFrom(context.settings()), OptionsFrom(context.settings())),
      map_(
          context, true, [this](const MapFollower::Delta& delta) { return Apply(*delta); },
          [this] {
            if (map_.is_complete()) context_.Finish();
          }),
      results_(context.Advertise(kLoopResult)),
      answers_(context.Advertise(kRelocalization)) {
  context.Subscribe(kRelocalizationRequest, [this](const RelocalizationRequest& request) {
    session_.Receive(request);
    Advance();
  });
  map_.ReadAhead();
  map_.FollowToEnd();
}

Result<> LoopCloserStage::Apply(const MapDelta& delta) {
  Result<> applied = session_.Receive(delta);
  Advance();
  return applied;
}

void LoopCloserStage::Advance() {
  const Overloaded publish{
      [](std::monostate) {},
      [this](const LoopResult& result) { results_.Publish(result); },
      [this](const RelocalizationAnswer& answer) { answers_.Publish(answer); },
  };
  while (session_.state() != LoopCloserSession::State::kIdle) {
    const StepTimer timer(context_);
    std::visit(publish, session_.Advance());
    ShowCounts();
  }
}

void LoopCloserStage::ShowCounts() {
  const LoopCounts& counts = session_.counts();
  const auto show = [this](const char* name, int64_t count) { context_.SetValue(name, static_cast<double>(count)); };
  show("loop_candidates", counts.num_candidates);
  show("loop_consistent", counts.num_consistent);
  show("loop_matched", counts.num_matched);
  show("loop_aligned", counts.num_aligned);
  show("loop_confirmed", counts.num_confirmed);
  show("loop_contradicted", counts.num_contradicted);
  show("relocalization_asked", counts.num_asked);
  show("relocalization_found", counts.num_found);
}

}  // namespace tessera
