#include "distribution/fair_queue.h"

#include <algorithm>
#include <utility>

namespace tessera {

bool FairQueue::Push(size_t robot, int64_t work, TileJob job) {
  Line& line = lines_[robot];
  if (line.jobs.size() >= kMaxWaiting) return false;
  if (line.jobs.empty()) line.start = std::max(virtual_time_, line.finish);
  line.jobs.push_back({work, std::move(job)});
  return true;
}

void FairQueue::Drop(size_t robot) { lines_[robot].jobs.clear(); }

bool FairQueue::empty() const {
  return std::all_of(lines_.begin(), lines_.end(), [](const Line& line) { return line.jobs.empty(); });
}

FairQueue::Turn FairQueue::Pop() {
  size_t best = lines_.size();
  for (size_t robot = 0; robot < lines_.size(); ++robot) {
    const Line& line = lines_[robot];
    if (!line.jobs.empty() && (best == lines_.size() || line.start < lines_[best].start)) best = robot;
  }
  Line& line = lines_[best];
  Turn turn{.robot = best, .work = line.jobs.front().work, .job = std::move(line.jobs.front().job)};
  line.jobs.pop_front();
  virtual_time_ = line.start;
  line.finish = line.start + turn.work;
  line.start = line.finish;
  return turn;
}

}  // namespace tessera
