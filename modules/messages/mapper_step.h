// What a step of the mapper changed, besides what follows from its input: enough to repeat it without its work.
#pragma once

#include <vector>

#include "map/map.h"
#include "map/removed_keyframes.h"

namespace tessera {

struct MapperStep {
  bool is_repeatable = false;  // else only `delta.number` and `delta.answers` are told: it has to be done again
  MapDelta delta;
  std::vector<KeyframeLink> removed;  // of the keyframes that it took out, as the mapper holds them
  LandmarkId first_recent;            // from this one on, what it made and kept has yet to prove itself
  LandmarkId end_landmark;            // the next id to be given out: some went in the step that made them
};

}  // namespace tessera
