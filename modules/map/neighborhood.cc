#include "map/neighborhood.h"

#include <algorithm>
#include <utility>

namespace tessera {

std::vector<KeyframeId> KeyframesAround(const Map& map, KeyframeId id, int max_num) {
  std::vector<KeyframeId> around = map.Covisible(id, max_num);
  around.insert(around.begin(), id);
  return around;
}

std::vector<LandmarkId> LandmarksSeenBy(const Map& map, std::span<const KeyframeId> keyframes) {
  IdSet<LandmarkId> landmarks(map.landmarks().end_id());
  for (const KeyframeId id : keyframes) {
    for (const LandmarkId landmark : map.FindKeyframe(id)->landmarks) {
      if (landmark.valid()) landmarks.Add(landmark);
    }
  }
  return landmarks.Ids();
}

std::vector<KeyframeId> BestObservers(const Map& map, std::span<const LandmarkId> landmarks,
                                      const IdSet<KeyframeId>& without, size_t max_num) {
  std::vector<int> num_seen(static_cast<size_t>(map.keyframes().end_id()));
  for (const LandmarkId landmark : landmarks) {
    for (const Observation& observation : map.ObservationsOf(landmark)) {
      ++num_seen[static_cast<size_t>(observation.keyframe.value)];
    }
  }
  std::vector<std::pair<int, KeyframeId>> ranked;
  for (size_t i = 0; i < num_seen.size(); ++i) {
    const KeyframeId id{static_cast<int64_t>(i)};
    if (num_seen[i] > 0 && !without.Has(id)) ranked.emplace_back(-num_seen[i], id);
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), max_num));
  std::vector<KeyframeId> best;
  for (const auto& [count, id] : ranked) best.push_back(id);
  return best;
}

}  // namespace tessera
