// Whose job an extractor does next, when several robots share it.
//
// Start-time fair queueing (Goyal, Vin and Cheng, 1996). With the work w of each job, and the virtual time v, which is
// the start of the job last taken, a robot's jobs have
//
//   start(job)  = finish(job before it)            if that one was still waiting or being done when the job came
//               = max(v, finish(job before it))    else: who had nothing to do gets nothing for it later
//   finish(job) = start(job) + w(job)
//
// and the one with the lowest start is next; then the one of the first robot. So over any time in which two robots both
// have jobs waiting, the work done for the one is that done for the other, up to the largest job of each. A job waits
// for the one being done, and, of each other robot, for no more work than its own robot has waiting before it and one
// job besides: a robot that floods makes its own jobs wait.
//
// The rule decides who waits for whom. What comes out of a job does not depend on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "features/feature_types.h"

namespace tessera {

class FairQueue {
 public:
  static constexpr size_t kMaxWaiting = 64;  // jobs of one robot; its dispatcher gives two at a time

  explicit FairQueue(size_t num_robots) : lines_(num_robots) {}

  // False if the robot has kMaxWaiting jobs waiting: the job is refused. `work` is at least 1.
  bool Push(size_t robot, int64_t work, TileJob job);
  // The robot wants none of its waiting jobs done any more.
  void Drop(size_t robot);

  bool empty() const;
  size_t num_waiting(size_t robot) const { return lines_[robot].jobs.size(); }

  struct Turn {
    size_t robot = 0;
    int64_t work = 0;
    TileJob job;
  };
  // Takes the next job; needs !empty().
  Turn Pop();

 private:
  struct Waiting {
    int64_t work = 0;
    TileJob job;
  };
  struct Line {
    std::deque<Waiting> jobs;  // in order of their coming
    int64_t start = 0;         // of the first of them
    int64_t finish = 0;        // of the last one that was taken
  };

  std::vector<Line> lines_;  // by robot
  int64_t virtual_time_ = 0;
};

}  // namespace tessera
