#include "stages/extractor/extractor_stage.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "core/errors.h"
#include "features/tiling.h"

namespace tessera {
namespace {

// A robot that gave no job for so long has no share of the extractor now.
constexpr int64_t kRecentUs = 2'000'000;

// extractor.robots: the prefixes of the robots that are served besides the one of this process's own prefix.
std::vector<std::string> OtherRobots(const Settings& settings) {
  const auto text = settings.Get<ExtractorSettings>().robots;
  std::set<std::string> known{settings.Get<BusSettings>().channel_prefix};
  std::vector<std::string> robots;
  std::istringstream words(text);
  for (std::string prefix; std::getline(words, prefix, ',');) {
    if (prefix.empty() || !known.insert(prefix).second) {
      throw InputError(
          "setting extractor.robots = `" + text +
          "` must be channel prefixes with commas between them, such as a_,b_: none empty, none twice, and "
          "not bus.channel_prefix, whose robot is served anyway");
    }
    robots.push_back(prefix);
  }
  if (robots.size() >= static_cast<size_t>(kMaxRobots)) {
    throw InputError("setting extractor.robots names " + std::to_string(robots.size()) +
                     " robots; an extractor serves " + std::to_string(kMaxRobots) + " at most");
  }
  return robots;
}

}  // namespace

ExtractorStage::ExtractorStage(StageContext& context) : ExtractorStage(context, OtherRobots(context.settings())) {}

ExtractorStage::ExtractorStage(StageContext& context, const std::vector<std::string>& other_robots)
    : context_(context), queue_(1 + other_robots.size()) {
  began_us_ = context.now_us();
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
  context.Subscribe(TileTopic(context.id()), [this, robot](const TileJob& job) { OnJob(robot, job); });
  context.Subscribe(kEndOfStream, [this, robot](const EndOfStream& end) { OnEnd(robot, end); });
}

void ExtractorStage::OnJob(size_t robot, const TileJob& job) {
  Robot& owner = robots_[robot];
  Result<> accepted = CheckTileJob(job);
  if (accepted) {
    if (job.run != owner.run) {
      // The robot's stack was started again: nobody waits for what its predecessor wanted.
      queue_.Drop(robot);
      owner.features.Forget();
      owner.run = job.run;
    }
    owner.job_came_us = context_.now_us();
    if (!queue_.Push(robot, WorkOf(job), job)) accepted = Failed("too many jobs of this robot wait already");
  }
  if (!accepted) {
    owner.context->ReportError("job for frame " + std::to_string(job.frame.value) + ", tile " +
                               std::to_string(job.tile) + " is refused: " + accepted.error().sentence);
  }
  owner.context->SetQueue(static_cast<int64_t>(queue_.num_waiting(robot)));
  if (!is_pool()) DoNextJob();  // nobody to be fair to: as it comes
}

void ExtractorStage::OnEnd(size_t robot, const EndOfStream& end) {
  if (end.stage != StageKind::kDispatcher) return;
  if (is_pool()) {
    robots_[robot].features.Forget();  // all its answers have arrived
  } else {
    context_.Finish();
  }
}

bool ExtractorStage::DoNextJob() {
  if (queue_.empty()) return false;
  const FairQueue::Turn turn = queue_.Pop();
  Robot& robot = robots_[turn.robot];
  TileFeatures features;
  {
    const StepTimer timer(*robot.context);
    features = extractor_.Extract(turn.job);
  }
  robot.features.Publish(features);
  ++num_jobs_done_;
  robot.work_done += turn.work;
  robot.context->SetQueue(static_cast<int64_t>(queue_.num_waiting(turn.robot)));
  context_.SetValue("work_" + robot.prefix, static_cast<double>(robot.work_done));
  return !queue_.empty();
}

void ExtractorStage::SayReady() {
  const auto num_robots = std::count_if(robots_.begin(), robots_.end(), [&](const Robot& robot) {
    return context_.now_us() - robot.job_came_us < kRecentUs;
  });
  for (const Robot& robot : robots_) {
    if (!robot.is_served) continue;
    robot.ready.Publish({.extractor = context_.id(),
                         .epoch_us = context_.epoch_us(),
                         .num_jobs_done = num_jobs_done_,
                         .num_robots = std::max(1, static_cast<int32_t>(num_robots))});
  }
}

}  // namespace tessera
