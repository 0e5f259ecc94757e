#include "distribution/extractor_session.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "core/errors.h"
#include "features/tile_packing.h"
#include "features/tiling.h"
#include "messages/topics.h"

namespace tessera {

std::vector<std::string> ParseRobots(const std::string& text, const std::string& own_prefix) {
  std::set<std::string> known{own_prefix};
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

Result<ExtractorSession::Taken> ExtractorSession::Receive(size_t robot, TileJob job, int64_t now_us) {
  const auto refused = [frame = job.frame.value, tile = job.tile](const std::string& why) {
    return Failed("job for frame " + std::to_string(frame) + ", tile " + std::to_string(tile) + " is refused: " + why);
  };
  if (const Result<> unpacked = UnpackTile(job); !unpacked) return refused(unpacked.error().sentence);
  if (const Result<> fits = CheckTileJob(job); !fits) return refused(fits.error().sentence);
  Robot& owner = robots_[robot];
  const bool is_new_run = job.run != owner.run;
  if (is_new_run) queue_.Drop(robot);
  owner.run = job.run;
  owner.job_came_us = now_us;
  const int64_t work = WorkOf(job);
  if (!queue_.Push(robot, work, std::move(job))) return refused("too many jobs of this robot wait already");
  return is_new_run ? Taken::kOfNewRun : Taken::kAsBefore;
}

TileFeatures ExtractorSession::Do(const FairQueue::Turn& turn) {
  TileFeatures features = extractor_.Extract(turn.job);
  ++num_jobs_done_;
  robots_[turn.robot].work_done += turn.work;
  return features;
}

ExtractorReady ExtractorSession::Ready(int id, int64_t epoch_us, int64_t now_us) const {
  const auto num_recent = std::count_if(robots_.begin(), robots_.end(),
                                        [&](const Robot& robot) { return now_us - robot.job_came_us < kRecentUs; });
  return {.extractor = id,
          .epoch_us = epoch_us,
          .num_jobs_done = num_jobs_done_,
          .num_robots = std::max(1, static_cast<int32_t>(num_recent))};
}

}  // namespace tessera
