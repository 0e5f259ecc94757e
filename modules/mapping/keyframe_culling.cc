#include "mapping/keyframe_culling.h"

#include <algorithm>
#include <limits>
#include <set>
#include <span>

namespace tessera {
namespace {

// Whether enough other keyframes observe the landmark at the scale of `own` or a finer one.
bool IsWellObserved(const Map& map, LandmarkId landmark, KeyframeId own, int level, int min_observers) {
  const std::span<const Observation> observations = map.ObservationsOf(landmark);
  if (observations.size() <= static_cast<size_t>(min_observers)) return false;
  int num_observers = 0;
  for (const Observation& observation : observations) {
    if (observation.keyframe == own) continue;
    const Keyframe& other = *map.FindKeyframe(observation.keyframe);
    num_observers += other.features->keypoints[static_cast<size_t>(observation.keypoint)].level <= level + 1 ? 1 : 0;
    if (num_observers >= min_observers) return true;
  }
  return false;
}

bool IsRedundant(const Map& map, KeyframeId id, const KeyframeCullingOptions& options) {
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const auto num_landmarks = std::count_if(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                                           [](LandmarkId landmark) { return landmark.valid(); });
  const double min_well_observed = options.redundant_share * static_cast<double>(num_landmarks);
  auto num_well_observed = num_landmarks;  // an upper bound until the loop ends
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const LandmarkId landmark = keyframe.landmarks[i];
    if (!landmark.valid()) continue;
    const int level = keyframe.features->keypoints[i].level;
    num_well_observed -= IsWellObserved(map, landmark, id, level, options.redundant_observers) ? 0 : 1;
    if (static_cast<double>(num_well_observed) <= min_well_observed)
      return false;  // most keyframes, after a few landmarks
  }
  return num_landmarks > 0;
}

}  // namespace

Result<> KeyframeCullingOptions::Check() const {
  if (!(redundant_share > 0.0) || redundant_observers < 1 || kept_newest < 1) {
    return Failed("the limits of redundant keyframes must be positive");
  }
  return {};
}

void CullKeyframes(KeyframeId center, const KeyframeCullingOptions& options, RemovedKeyframes& removed,
                   MapEditor& editor) {
  const Map& map = editor.map();
  std::set<KeyframeId> closed_a_loop;
  for (const ClosedLoop& loop : map.closed_loops()) {
    closed_a_loop.insert(loop.current);
    closed_a_loop.insert(loop.matched);
  }
  for (const KeyframeId id : map.Covisible(center, std::numeric_limits<int>::max())) {
    if (closed_a_loop.contains(id)) continue;
    const KeyframeId parent = map.FindKeyframe(id)->parent;
    if (!parent.valid() || id.value > center.value - options.kept_newest || !IsRedundant(map, id, options)) continue;
    map.keyframes().ForEach([&](KeyframeId child, const Keyframe& keyframe) {
      if (keyframe.parent == id) editor.SetParent(child, parent);
    });
    removed.Remember(map, id);
    editor.RemoveKeyframe(id);
  }
}

}  // namespace tessera
