#include "map/local_window.h"

#include <algorithm>
#include <map>
#include <set>

#include "map/neighborhood.h"

namespace tessera {
namespace {

// The keyframes outside `inner` that see most of the landmarks; ties go to the lower id. Sorted by id.
std::vector<KeyframeId> BestOutsiders(const Map& map, const std::vector<KeyframeId>& inner,
                                      const std::vector<LandmarkId>& landmarks, int max_num) {
  std::map<KeyframeId, int> num_seen;
  for (const LandmarkId landmark : landmarks) {
    for (const Observation& observation : map.ObservationsOf(landmark)) {
      ++num_seen[observation.keyframe];
    }
  }
  for (const KeyframeId id : inner) num_seen.erase(id);
  std::vector<std::pair<int, KeyframeId>> ranked;
  for (const auto& [id, count] : num_seen) ranked.emplace_back(-count, id);
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), static_cast<size_t>(max_num)));
  std::vector<KeyframeId> outer;
  for (const auto& [count, id] : ranked) outer.push_back(id);
  std::sort(outer.begin(), outer.end());
  return outer;
}

}  // namespace

Result<> LocalWindowOptions::Check() const {
  if (max_inner_keyframes < 2) return Failed("mapper.max_inner_keyframes must be at least 2");
  if (min_shared_landmarks < 1) return Failed("mapper.min_shared_landmarks must be at least 1");
  if (max_outer_keyframes < 1) return Failed("mapper.max_outer_keyframes must be at least 1");
  return {};
}

LocalWindow SelectLocalWindow(const Map& map, KeyframeId center, const LocalWindowOptions& options) {
  LocalWindow window;
  window.inner = map.Covisible(center, options.max_inner_keyframes - 1, options.min_shared_landmarks);
  window.inner.push_back(center);
  std::sort(window.inner.begin(), window.inner.end());
  window.landmarks = LandmarksSeenBy(map, window.inner);
  window.outer = BestOutsiders(map, window.inner, window.landmarks, options.max_outer_keyframes);

  std::set<KeyframeId> members(window.inner.begin(), window.inner.end());
  members.insert(window.outer.begin(), window.outer.end());
  std::erase_if(window.landmarks, [&](LandmarkId landmark) {
    const std::vector<Observation>& observations = map.ObservationsOf(landmark);
    return std::count_if(observations.begin(), observations.end(),
                         [&](const Observation& observation) { return members.contains(observation.keyframe); }) < 2;
  });
  return window;
}

}  // namespace tessera
