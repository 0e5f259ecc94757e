#include "map/local_window.h"

#include <algorithm>

#include "map/neighborhood.h"

namespace tessera {

Result<> LocalWindowOptions::Check() const {
  if (max_inner_keyframes < 2) return Failed("max_inner_keyframes must be at least 2");
  if (min_shared_landmarks < 1) return Failed("min_shared_landmarks must be at least 1");
  if (max_outer_keyframes < 1) return Failed("max_outer_keyframes must be at least 1");
  return {};
}

LocalWindow SelectLocalWindow(const Map& map, KeyframeId center, const LocalWindowOptions& options) {
  LocalWindow window;
  window.inner = map.Covisible(center, options.max_inner_keyframes - 1, options.min_shared_landmarks);
  window.inner.push_back(center);
  std::sort(window.inner.begin(), window.inner.end());
  window.landmarks = LandmarksSeenBy(map, window.inner);
  IdSet<KeyframeId> members(map.keyframes().end_id());
  for (const KeyframeId id : window.inner) members.Add(id);
  window.outer = BestObservers(map, window.landmarks, members, static_cast<size_t>(options.max_outer_keyframes));
  std::sort(window.outer.begin(), window.outer.end());
  for (const KeyframeId id : window.outer) members.Add(id);
  std::erase_if(window.landmarks, [&](LandmarkId landmark) {
    const std::span<const Observation> observations = map.ObservationsOf(landmark);
    return std::count_if(observations.begin(), observations.end(),
                         [&](const Observation& observation) { return members.Has(observation.keyframe); }) < 2;
  });
  return window;
}

}  // namespace tessera
