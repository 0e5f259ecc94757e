// What an extractor does with the jobs of one robot, or of several that share it: jobs in, their candidates out. No
// bus, and the time is told. Whose job is next stands in fair_queue.h; here is which jobs are taken:
//
//   a job that is malformed, or of a robot that has too many waiting, is refused
//   a job of another run than those before it says that the robot's stack was started again: nobody waits for what its
//   predecessor wanted
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/result.h"
#include "distribution/fair_queue.h"
#include "features/extractor.h"
#include "messages/stage_messages.h"

namespace tessera {

// The prefixes in `text`, with commas between them: the robots that are served besides that of `own_prefix`. Throws
// InputError if one is empty or named twice, or if they are too many.
std::vector<std::string> ParseRobots(const std::string& text, const std::string& own_prefix);

class ExtractorSession {
 public:
  explicit ExtractorSession(size_t num_robots) : queue_(num_robots), robots_(num_robots) {}

  // Whether it serves robots that come and go.
  bool is_pool() const { return robots_.size() > 1; }

  enum class Taken { kAsBefore, kOfNewRun };  // kOfNewRun: what was answered before is not needed any longer
  // Fails if the job is refused.
  Result<Taken> Receive(size_t robot, TileJob job, int64_t now_us);

  bool has_jobs() const { return !queue_.empty(); }
  size_t num_waiting(size_t robot) const { return queue_.num_waiting(robot); }
  // Takes the next job; needs has_jobs().
  FairQueue::Turn TakeNext() { return queue_.Pop(); }
  TileFeatures Do(const FairQueue::Turn& turn);
  int64_t work_done(size_t robot) const { return robots_[robot].work_done; }  // as WorkOf

  // What the extractor `id` that was started at `epoch_us` says to each robot.
  ExtractorReady Ready(int id, int64_t epoch_us, int64_t now_us) const;

  // A robot that gave no job for so long has no share of the extractor now.
  static constexpr int64_t kRecentUs = 2'000'000;

 private:
  struct Robot {
    int64_t run = 0;                      // whose jobs are done
    int64_t job_came_us = INT64_MIN / 2;  // the last one
    int64_t work_done = 0;
  };

  FairQueue queue_;
  Extractor extractor_;
  std::vector<Robot> robots_;
  int64_t num_jobs_done_ = 0;
};

}  // namespace tessera
