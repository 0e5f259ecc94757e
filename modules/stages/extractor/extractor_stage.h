// Wiring of an extractor: jobs in, their candidates out, for one robot or for several in turn. Which jobs are taken
// stands in distribution/extractor_session.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "distribution/extractor_session.h"
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
  };

  ExtractorStage(StageContext& context, const std::vector<std::string>& other_robots);
  void Serve(size_t robot);
  // Begins to serve those robots of which it is known that no other process has this one's name there.
  void ServeOthers();
  void OnJob(size_t robot, TileJob job);
  void OnEnd(size_t robot, const EndOfStream& end);
  // Does one job. Whether more wait.
  bool DoNextJob();
  void SayReady();

  StageContext& context_;
  std::vector<Robot> robots_;
  ExtractorSession session_;
  int64_t began_us_ = 0;
};

}  // namespace tessera
