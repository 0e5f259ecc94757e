// Wiring of the occupancy map: images, poses, keyframes and changes of the map in; OCCUPANCY and the files of the run
// out. What happens between them stands in occupancy/occupancy_session.h. Nobody waits for it but the end of the run.
#pragma once

#include <cstdint>
#include <string>

#include "occupancy/occupancy_grid.h"
#include "occupancy/occupancy_session.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class OccupancyStage {
 public:
  // Throws InputError if the settings make no sense.
  explicit OccupancyStage(StageContext& context);

 private:
  template <class Value>
  void Receive(const Topic<Value>& topic);
  bool Advance();
  void Publish();
  void WatchTheEnd();
  void Finish();
  void WriteFiles() const;

  StageContext& context_;
  const std::string out_dir_;
  const HeightBand band_;
  OccupancySession session_;
  MapSubscription map_;
  Publisher<OccupancyUpdate> updates_;
  bool is_whole_wanted_ = false;
  int64_t num_published_ = 0;
  int64_t last_news_us_ = 0;  // when the last value came, or the last step was taken
};

}  // namespace tessera
