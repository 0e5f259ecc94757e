// Wiring of an extractor: jobs in, their candidates out, for one robot or for several in turn.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "distribution/fair_queue.h"
#include "features/extractor.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class ExtractorStage {
 public:
  explicit ExtractorStage(StageContext& context);

 private:
  struct Robot {
    StageContext* context = nullptr;
    std::string prefix;      // of its channels
    bool is_served = false;  // advertised and subscribed
    Publisher<TileFeatures> features;
    Publisher<ExtractorReady> ready;
    int64_t run = 0;                      // whose jobs are done
    int64_t job_came_us = INT64_MIN / 2;  // the last one
    int64_t work_done = 0;                // as WorkOf
  };

  ExtractorStage(StageContext& context, const std::vector<std::string>& other_robots);
  // Serves robots that come and go.
  bool is_pool() const { return robots_.size() > 1; }
  void Serve(size_t robot);
  // Begins to serve those robots of which it is known that no other process has this one's name there.
  void ServeOthers();
  void OnJob(size_t robot, const TileJob& job);
  void OnEnd(size_t robot, const EndOfStream& end);
  // Does one job. Whether more wait.
  bool DoNextJob();
  void SayReady();

  StageContext& context_;
  std::vector<Robot> robots_;
  FairQueue queue_;
  Extractor extractor_;
  int64_t began_us_ = 0;
  int64_t num_jobs_done_ = 0;
};

}  // namespace tessera
