// Who works on what: the frames that wait, the jobs they were cut into, and the extractors that are free.
//
// A job is given to a free extractor, and kept until its frame is tracked. It is given again when its extractor died,
// restarted, or does not answer in time, and when the reassembler that acknowledged its candidates died with them;
// answering twice does no harm, since the answers are the same bit for bit. So wall time decides who works, never what
// comes out.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "features/feature_types.h"
#include "features/tiling.h"
#include "geometry/camera_frame.h"

namespace tessera {

struct WorkQueueOptions {
  TileGrid grid;                 // how frames are cut
  int coarse_levels_from = 4;    // first pyramid level that is not cut
  FeatureOptions features;       // what is asked of extractors
  int max_queued_frames = 32;    // frames that wait; when full, a new one is dropped
  int max_frames_in_flight = 6;  // frames given out and not yet tracked: bounds every queue downstream
  int jobs_per_extractor = 2;    // one to work on, one on its way
  // A job without an answer for this long is given to another; for n times as long, if the extractor works for n
  // robots.
  int64_t late_us = 2'000'000;
  int64_t silent_us = 1'500'000;  // an extractor that says nothing for this long is dead

  Result<> Check() const;
};

class WorkQueue {
 public:
  explicit WorkQueue(const WorkQueueOptions& options);

  // A frame has come; frames must come in order. False: the queue was full and the frame is dropped, unless it must be
  // kept.
  bool AddFrame(CameraFrame frame, const CameraCalibration& calibration, int64_t captured_us, bool must_keep = false);
  // The last frame that waits is not wanted any more; nullopt: none waits.
  std::optional<FrameId> DropNewestWaiting();
  // A frame has come that was tracked before this queue was made.
  void SkipFrame(FrameId frame) { last_frame_ = frame; }
  // Jobs that are given from now on are of this run.
  void SetRun(int64_t run) { run_ = run; }
  // An extractor says that it lives (`epoch_us`: since when), and how many robots share it.
  void HearExtractor(int extractor, int64_t epoch_us, int64_t now_us, int32_t num_robots = 1);
  // The reassembler has these tiles.
  void Acknowledge(FrameId frame, const std::vector<int32_t>& tiles);
  // The reassembler does not have these tiles: it needs all their candidates. They are given again.
  void WantAll(FrameId frame, const std::vector<int32_t>& tiles);
  // What was chosen of a frame (features/selection.h): candidates far below that are not asked of those that are cut
  // from now on.
  void SetLowestPriority(const std::vector<int32_t>& lowest_priority);
  // The reassembler lost all that it has acknowledged.
  void GiveAllAgain();
  // The tracker has finished this frame and all before it.
  void MarkTracked(FrameId frame);

  struct Assignment {
    int extractor = 0;
    const TileJob* job = nullptr;  // valid until the queue is changed
  };
  // Whether there is both a job to give and a free extractor.
  bool CanGive() const;
  // Gives the next job to the next free extractor; needs CanGive().
  Assignment GiveNext(int64_t now_us);
  // Takes back jobs from extractors that died, and lets others have the jobs that are late.
  void CheckExtractors(int64_t now_us);

  // Nothing waits and everything given out is acknowledged.
  bool idle() const { return waiting_.empty() && num_open_ == 0; }
  int num_waiting() const { return static_cast<int>(waiting_.size()); }
  int num_extractors() const { return static_cast<int>(extractors_.size()); }
  int num_in_flight() const { return static_cast<int>(untracked_.size()); }
  int64_t num_given_again() const { return num_given_again_; }
  int64_t num_wanted_whole() const { return num_wanted_whole_; }
  // The last frame that was not dropped; invalid if there was none.
  FrameId last_frame() const { return last_frame_; }

 private:
  struct JobKey {
    FrameId frame;
    int32_t tile = 0;
    auto operator<=>(const JobKey&) const = default;
  };
  struct Job {
    TileJob job;
    int avoid = -1;  // the extractor that failed it; another is preferred
    bool is_acknowledged = false;
  };
  struct Waiting {
    CameraFrame frame;
    CameraCalibration calibration;
    int64_t captured_us = 0;
    FrameId previous_frame;
  };
  struct Worker {
    int64_t epoch_us = 0;
    int64_t heard_us = 0;
    int32_t num_robots = 1;              // that share it
    int64_t free_since = 0;              // turn at which its last job ended: the queue of free extractors
    std::map<JobKey, int64_t> given_us;  // its jobs, and when it got them
  };

  void CutNextFrame();
  int FreeExtractor(int avoid) const;
  void FreeWorkersOf(const JobKey& key);
  void TakeBack(Worker& worker, int extractor);

  WorkQueueOptions options_;
  std::deque<Waiting> waiting_;
  std::map<JobKey, Job> jobs_;   // of untracked frames
  int64_t num_open_ = 0;         // of those, not acknowledged
  std::deque<JobKey> to_give_;   // of those, the ones that nobody works on, in order
  std::set<FrameId> untracked_;  // frames cut and not yet tracked
  std::map<int, Worker> extractors_;
  FrameId last_frame_;
  int64_t run_ = 0;
  int64_t turn_ = 0;  // counts ended jobs
  int64_t num_given_again_ = 0;
  int64_t num_wanted_whole_ = 0;
  std::vector<int32_t> min_priority_;  // of jobs of frames that are cut
};

}  // namespace tessera
