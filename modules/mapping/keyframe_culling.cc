#include "mapping/keyframe_culling.h"

#include <algorithm>
#include <limits>
#include <set>
#include <span>
#include <vector>

namespace tessera {
namespace {

// Which visit of the map made a keyframe, counted from 0.
class Visits {
 public:
  explicit Visits(const Map& map) {
    FrameId last;
    map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
      if (keyframe.features->frame < last) begins_.push_back(id);
      last = keyframe.features->frame;
    });
  }
  int Of(KeyframeId id) const {
    return static_cast<int>(std::upper_bound(begins_.begin(), begins_.end(), id) - begins_.begin());
  }

 private:
  std::vector<KeyframeId> begins_;  // of the second and later ones
};

// Who may stand in for a keyframe.
struct Others {
  int last_visit = 0;  // those of later ones don't count
  int min_observers = 1;
  double share = 1.0;  // of the landmarks must be observed by so many
};

class RedundancyCheck {
 public:
  RedundancyCheck(const Map& map, const KeyframeCullingOptions& options) : map_(map), options_(options), visits_(map) {}

  bool IsRedundant(KeyframeId id) const {
    const int visit = visits_.Of(id);
    if (CanStandIn({visit, options_.redundant_observers, options_.redundant_share}, id)) return true;
    return visit > 0 && CanStandIn({visit - 1, 1, options_.known_share}, id) && NeighborsHoldWithout(id);
  }

 private:
  bool CanStandIn(const Others& others, KeyframeId id) const {
    const Keyframe& keyframe = *map_.FindKeyframe(id);
    const auto num_landmarks = std::count_if(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                                             [](LandmarkId landmark) { return landmark.valid(); });
    const double min_well_observed = others.share * static_cast<double>(num_landmarks);
    auto num_well_observed = num_landmarks;  // an upper bound until the loop ends
    for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
      const LandmarkId landmark = keyframe.landmarks[i];
      if (!landmark.valid()) continue;
      const int level = keyframe.features->keypoints[i].level;
      num_well_observed -= IsWellObserved(landmark, id, level, others) ? 0 : 1;
      if (static_cast<double>(num_well_observed) <= min_well_observed)
        return false;  // most keyframes, after a few landmarks
    }
    return num_landmarks > 0;
  }

  // Whether enough other keyframes observe the landmark at the scale of `own` or a finer one.
  bool IsWellObserved(LandmarkId landmark, KeyframeId own, int level, const Others& others) const {
    const std::span<const Observation> observations = map_.ObservationsOf(landmark);
    if (observations.size() <= static_cast<size_t>(others.min_observers)) return false;
    int num_observers = 0;
    for (const Observation& observation : observations) {
      if (observation.keyframe == own || visits_.Of(observation.keyframe) > others.last_visit) continue;
      const Keyframe& other = *map_.FindKeyframe(observation.keyframe);
      num_observers += other.features->keypoints[Index(observation.keypoint)].level <= level + 1 ? 1 : 0;
      if (num_observers >= others.min_observers) return true;
    }
    return false;
  }

  // Whether the keyframes around `id` are one group by what they share with one another.
  bool NeighborsHoldWithout(KeyframeId id) const {
    std::vector<KeyframeId> apart = map_.Covisible(id, std::numeric_limits<int>::max(), options_.min_tie);
    if (apart.empty()) return false;
    std::vector<KeyframeId> group = {apart.back()};
    apart.pop_back();
    for (size_t i = 0; i < group.size() && !apart.empty(); ++i) {
      const auto held = std::partition(apart.begin(), apart.end(), [&](KeyframeId other) {
        return map_.NumShared(group[i], other) < options_.min_tie;
      });
      group.insert(group.end(), held, apart.end());
      apart.erase(held, apart.end());
    }
    return apart.empty();
  }

  const Map& map_;
  const KeyframeCullingOptions& options_;
  const Visits visits_;
};

}  // namespace

Result<> KeyframeCullingOptions::Check() const {
  if (!(redundant_share > 0.0) || !(known_share > 0.0) || redundant_observers < 1 || min_tie < 1 || kept_newest < 1) {
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
  const RedundancyCheck check(map, options);
  for (const KeyframeId id : map.Covisible(center, std::numeric_limits<int>::max())) {
    if (closed_a_loop.contains(id)) continue;
    const KeyframeId parent = map.FindKeyframe(id)->parent;
    if (!parent.valid() || id.value > center.value - options.kept_newest || !check.IsRedundant(id)) continue;
    map.keyframes().ForEach([&](KeyframeId child, const Keyframe& keyframe) {
      if (keyframe.parent == id) editor.SetParent(child, parent);
    });
    removed.Remember(map, id);
    editor.RemoveKeyframe(id);
  }
}

}  // namespace tessera
