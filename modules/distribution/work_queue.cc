#include "distribution/work_queue.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace tessera {
namespace {

// Quarters of the lowest priority that was chosen of a frame, below which candidates are not asked of later ones: low
// enough that hardly a frame needs more of them (README.md of features).
constexpr int kGuess = 3;

}  // namespace

Result<> WorkQueueOptions::Check() const {
  if (max_queued_frames < 1) return Failed("at least one frame must fit the queue");
  if (max_frames_in_flight < 1) return Failed("at least one frame must be in flight");
  if (jobs_per_extractor < 1) return Failed("an extractor must get at least one job");
  if (coarse_levels_from < 1) return Failed("level 0 must be cut");
  if (late_us <= 0 || silent_us <= 0)
    return Failed("times after which jobs are late and extractors dead must be positive");
  return features.Check();
}

WorkQueue::WorkQueue(const WorkQueueOptions& options) : options_(options) {}

bool WorkQueue::AddFrame(CameraFrame frame, const CameraCalibration& calibration, int64_t captured_us, bool must_keep) {
  if (!must_keep && num_waiting() >= options_.max_queued_frames) {
    return false;
  }
  const FrameId id = frame.id;
  waiting_.push_back({std::move(frame), calibration, captured_us, last_frame_});
  last_frame_ = id;
  return true;
}

std::optional<FrameId> WorkQueue::DropNewestWaiting() {
  if (waiting_.empty()) return std::nullopt;
  const FrameId dropped = waiting_.back().frame.id;
  last_frame_ = waiting_.back().previous_frame;
  waiting_.pop_back();
  return dropped;
}

void WorkQueue::HearExtractor(int extractor, int64_t epoch_us, int64_t now_us, int32_t num_robots) {
  Worker& worker = extractors_[extractor];
  if (worker.epoch_us != epoch_us) {
    // A new process under the old name: what its predecessor had died with it.
    TakeBack(worker, extractor);
    worker.epoch_us = epoch_us;
    worker.free_since = turn_;
  }
  worker.heard_us = now_us;
  worker.num_robots = num_robots;
}

void WorkQueue::Acknowledge(FrameId frame, const std::vector<int32_t>& tiles) {
  for (const int32_t tile : tiles) {
    const JobKey key{frame, tile};
    const auto job = jobs_.find(key);
    if (job == jobs_.end() || job->second.is_acknowledged) {
      continue;  // answered twice
    }
    job->second.is_acknowledged = true;
    --num_open_;
    std::erase(to_give_, key);
    FreeWorkersOf(key);
  }
}

void WorkQueue::WantAll(FrameId frame, const std::vector<int32_t>& tiles) {
  for (const int32_t tile : tiles) {
    const JobKey key{frame, tile};
    const auto found = jobs_.find(key);
    if (found == jobs_.end()) continue;
    Job& job = found->second;
    if (job.job.min_priority.empty()) continue;  // they are on their way
    job.job.min_priority.clear();
    FreeWorkersOf(key);
    std::erase(to_give_, key);
    to_give_.push_front(key);
    if (std::exchange(job.is_acknowledged, false)) ++num_open_;
    ++num_wanted_whole_;
  }
}

void WorkQueue::SetLowestPriority(const std::vector<int32_t>& lowest_priority) {
  min_priority_ = lowest_priority;
  for (int32_t& priority : min_priority_) priority = priority / 4 * kGuess;
}

void WorkQueue::FreeWorkersOf(const JobKey& key) {
  ++turn_;
  for (auto& [id, worker] : extractors_) {
    if (worker.given_us.erase(key) > 0) {
      worker.free_since = turn_;
    }
  }
}

void WorkQueue::GiveAllAgain() {
  to_give_.clear();
  for (auto& [id, worker] : extractors_) worker.given_us.clear();
  for (auto& [key, job] : jobs_) {
    job.is_acknowledged = false;
    to_give_.push_back(key);
  }
  num_open_ = static_cast<int64_t>(jobs_.size());
  num_given_again_ += num_open_;
}

void WorkQueue::MarkTracked(FrameId frame) {
  untracked_.erase(untracked_.begin(), untracked_.upper_bound(frame));
  while (!waiting_.empty() && waiting_.front().frame.id <= frame) waiting_.pop_front();
  for (auto job = jobs_.begin(); job != jobs_.end() && job->first.frame <= frame; job = jobs_.erase(job)) {
    if (job->second.is_acknowledged) continue;
    --num_open_;  // its reassembler died after it had released the frame
    std::erase(to_give_, job->first);
    FreeWorkersOf(job->first);
  }
}

bool WorkQueue::CanGive() const {
  const bool can_cut = !waiting_.empty() && num_in_flight() < options_.max_frames_in_flight;
  return (can_cut || !to_give_.empty()) && FreeExtractor(-1) >= 0;
}

WorkQueue::Assignment WorkQueue::GiveNext(int64_t now_us) {
  if (to_give_.empty()) {
    CutNextFrame();
  }
  const JobKey key = to_give_.front();
  to_give_.pop_front();
  Job& job = jobs_.at(key);
  job.job.run = run_;
  const int extractor = FreeExtractor(job.avoid);
  extractors_.at(extractor).given_us[key] = now_us;
  return {extractor, &job.job};
}

void WorkQueue::CheckExtractors(int64_t now_us) {
  for (auto it = extractors_.begin(); it != extractors_.end();) {
    auto& [extractor, worker] = *it;
    if (now_us - worker.heard_us > options_.silent_us) {
      TakeBack(worker, extractor);
      it = extractors_.erase(it);
      continue;
    }
    // Late jobs: the worker may still answer, but somebody else tries too.
    const bool is_late = std::any_of(worker.given_us.begin(), worker.given_us.end(), [&](const auto& given) {
      return now_us - given.second > options_.late_us * worker.num_robots;
    });
    if (is_late) {
      TakeBack(worker, extractor);
    }
    ++it;
  }
}

// Cuts the oldest waiting frame.
void WorkQueue::CutNextFrame() {
  Waiting next = std::move(waiting_.front());
  waiting_.pop_front();
  untracked_.insert(next.frame.id);
  std::vector<TileJob> jobs = CutFrame(std::move(next.frame), next.calibration, next.captured_us, options_.grid,
                                       options_.coarse_levels_from, options_.features);
  for (TileJob& job : jobs) {
    if (jobs.size() > 1) job.min_priority = min_priority_;
    job.previous_frame = next.previous_frame;
    const JobKey key{job.frame, job.tile};
    jobs_[key].job = std::move(job);
    ++num_open_;
    to_give_.push_back(key);
  }
}

// The extractor with the fewest jobs among those with room; then the one that waits longest; then the lowest id.
// `avoid` is taken only if there is no other. -1 if all are busy.
int WorkQueue::FreeExtractor(int avoid) const {
  int best = -1;
  const auto rank = [&](int extractor) {
    const Worker& worker = extractors_.at(extractor);
    return std::tuple(extractor == avoid, worker.given_us.size(), worker.free_since, extractor);
  };
  for (const auto& [extractor, worker] : extractors_) {
    const bool has_room = static_cast<int>(worker.given_us.size()) < options_.jobs_per_extractor;
    if (has_room && (best < 0 || rank(extractor) < rank(best))) {
      best = extractor;
    }
  }
  return best;
}

// The worker's jobs go back to the front of the queue, the oldest first.
void WorkQueue::TakeBack(Worker& worker, int extractor) {
  for (auto it = worker.given_us.rbegin(); it != worker.given_us.rend(); ++it) {
    const JobKey& key = it->first;
    if (std::find(to_give_.begin(), to_give_.end(), key) != to_give_.end()) {
      continue;
    }
    jobs_.at(key).avoid = extractor;
    to_give_.push_front(key);
    ++num_given_again_;
  }
  worker.given_us.clear();
}

}  // namespace tessera
