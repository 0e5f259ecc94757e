// Wiring of the map writer: joins a running stack at any time, follows the map, and writes it as a cloud of points.
#pragma once

#include <string>

#include "map/map.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class MapWriterStage {
 public:
  // Throws InputError if no path is given.
  explicit MapWriterStage(StageContext& context);

 private:
  Result<> Apply(const MapDelta& delta);
  void WriteIfDone();

  StageContext& context_;
  const std::string path_;
  const bool follows_;
  MapSubscription map_;
  Map replica_;
};

}  // namespace tessera
