#include "stages/extractor/extractor_stage.h"

#include <utility>

namespace tessera {
namespace {

// extractor.robots: the prefixes of the robots that are served besides the one of this process's own prefix.
std::vector<std::string> OtherRobots(const Settings& settings) {
  return ParseRobots(settings.Get<ExtractorSettings>().robots, settings.Get<BusSettings>().channel_prefix);
}

}  // namespace

ExtractorStage::ExtractorStage(StageContext& context) : ExtractorStage(context, OtherRobots(context.settings())) {}

ExtractorStage::ExtractorStage(StageContext& context, const std::vector<std::string>& other_robots)
    : context_(context), session_(1 + other_robots.size()), began_us_(context.now_us()) {
  robots_.push_back({.context = &context, .prefix = context.settings().Get<BusSettings>().channel_prefix});
  Serve(0);
  for (const std::string& prefix : other_robots) {
    robots_.push_back({.context = &context.JoinRobot(prefix), .prefix = prefix});
  }
  context.WhenIdle([this] { return DoNextJob(); });
  context.Every(std::chrono::milliseconds(400), [this] {
    ServeOthers();
    SayReady();
  });
}

void ExtractorStage::ServeOthers() {
  const int64_t two_heartbeats_us = 2000LL * context_.settings().Get<StreamTimingSettings>().heartbeat_ms;
  if (context_.now_us() - began_us_ < two_heartbeats_us) return;
  for (size_t robot = 0; robot < robots_.size(); ++robot) {
    if (!robots_[robot].is_served && !robots_[robot].context->fell_silent()) Serve(robot);
  }
}

void ExtractorStage::Serve(size_t robot) {
  StageContext& context = *robots_[robot].context;
  robots_[robot].is_served = true;
  robots_[robot].features = context.Advertise(kTileFeatures);
  robots_[robot].ready = context.Advertise(kExtractorReady);
  context.Subscribe(TileTopic(context.id()), [this, robot](TileJob job) { OnJob(robot, std::move(job)); });
  context.Subscribe(kEndOfStream, [this, robot](const EndOfStream& end) { OnEnd(robot, end); });
}

void ExtractorStage::OnJob(size_t robot, TileJob job) {
  const Robot& owner = robots_[robot];
  const auto taken = session_.Receive(robot, std::move(job), context_.now_us());
  if (!taken) owner.context->ReportError(taken.error().sentence);
  if (taken && *taken == ExtractorSession::Taken::kOfNewRun) owner.features.Forget();
  owner.context->SetQueue(static_cast<int64_t>(session_.num_waiting(robot)));
  if (!session_.is_pool()) DoNextJob();  // nobody to be fair to: as it comes
}

void ExtractorStage::OnEnd(size_t robot, const EndOfStream& end) {
  if (end.stage != StageKind::kDispatcher) return;
  if (session_.is_pool()) {
    robots_[robot].features.Forget();  // all its answers have arrived
  } else {
    context_.Finish();
  }
}

bool ExtractorStage::DoNextJob() {
  if (!session_.has_jobs()) return false;
  const FairQueue::Turn turn = session_.TakeNext();
  const Robot& robot = robots_[turn.robot];
  TileFeatures features;
  {
    const StepTimer timer(*robot.context);
    features = session_.Do(turn);
  }
  robot.features.Publish(features);
  robot.context->SetQueue(static_cast<int64_t>(session_.num_waiting(turn.robot)));
  context_.SetValue("work_" + robot.prefix, static_cast<double>(session_.work_done(turn.robot)));
  return session_.has_jobs();
}

void ExtractorStage::SayReady() {
  const ExtractorReady ready = session_.Ready(context_.id(), context_.epoch_us(), context_.now_us());
  for (const Robot& robot : robots_) {
    if (robot.is_served) robot.ready.Publish(ready);
  }
}

}  // namespace tessera
