#include "mapping/keyframe_culling.h"

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <span>
#include <vector>

namespace tessera {
namespace {

constexpr uint8_t kUnknownLevel = 255, kNoLevel = 254;

// Who may stand in for a keyframe.
struct Others {
  int last_visit = 0;  // those of later ones don't count
  int min_observers = 1;
  double share = 1.0;  // of the landmarks must be observed by so many
};

// Whether `is_well_observed` holds for more than this share of the keyframe's landmarks. It is given the landmark and
// the level at which the keyframe observes it.
template <class IsWellObserved>
bool HoldsForMost(const Keyframe& keyframe, double share, IsWellObserved is_well_observed) {
  const auto num_landmarks = std::count_if(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                                           [](LandmarkId landmark) { return landmark.valid(); });
  const double min_well_observed = share * static_cast<double>(num_landmarks);
  auto num_well_observed = num_landmarks;  // an upper bound until the loop ends
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const LandmarkId landmark = keyframe.landmarks[i];
    if (!landmark.valid()) continue;
    num_well_observed -= is_well_observed(landmark, keyframe.features->keypoints[i].level) ? 0 : 1;
    if (static_cast<double>(num_well_observed) <= min_well_observed) return false;  // most, after a few landmarks
  }
  return num_landmarks > 0;
}

// Whether enough other keyframes observe the landmark at the scale of `own` or a finer one.
bool IsWellObserved(const Map& map, const Visits& visits, LandmarkId landmark, KeyframeId own, int level,
                    const Others& others) {
  const std::span<const Observation> observations = map.ObservationsOf(landmark);
  if (observations.size() <= static_cast<size_t>(others.min_observers)) return false;
  int num_observers = 0;
  for (const Observation& observation : observations) {
    if (observation.keyframe == own || visits.Of(observation.keyframe) > others.last_visit) continue;
    const Keyframe& other = *map.FindKeyframe(observation.keyframe);
    num_observers += other.features->keypoints[Index(observation.keypoint)].level <= level + 1 ? 1 : 0;
    if (num_observers >= others.min_observers) return true;
  }
  return false;
}

bool CanStandIn(const Map& map, const Visits& visits, const Others& others, KeyframeId id) {
  return HoldsForMost(*map.FindKeyframe(id), others.share, [&](LandmarkId landmark, int level) {
    return IsWellObserved(map, visits, landmark, id, level, others);
  });
}

// Whether the keyframes around `id` are one group by what they share with one another.
bool NeighborsHoldWithout(const Map& map, KeyframeId id, int min_tie) {
  std::vector<KeyframeId> apart = map.Covisible(id, std::numeric_limits<int>::max(), min_tie);
  if (apart.empty()) return false;
  std::vector<KeyframeId> group = {apart.back()};
  apart.pop_back();
  for (size_t i = 0; i < group.size() && !apart.empty(); ++i) {
    const auto held = std::partition(apart.begin(), apart.end(),
                                     [&](KeyframeId other) { return map.NumShared(group[i], other) < min_tie; });
    group.insert(group.end(), held, apart.end());
    apart.erase(held, apart.end());
  }
  return apart.empty();
}

std::set<KeyframeId> KeyframesOfLoops(const Map& map) {
  std::set<KeyframeId> ids;
  for (const ClosedLoop& loop : map.closed_loops()) {
    ids.insert(loop.current);
    ids.insert(loop.matched);
  }
  return ids;
}

}  // namespace

Result<> KeyframeCullingOptions::Check() const {
  if (!(redundant_share > 0.0) || !(known_share > 0.0) || redundant_observers < 1 || min_tie < 1 || kept_newest < 1) {
    return Failed("the limits of redundant keyframes must be positive");
  }
  return {};
}

void Visits::Update(const Map& map, KeyframeId newest) {
  if (last_.valid()) {
    Add(newest, *map.FindKeyframe(newest));
  } else {
    map.keyframes().ForEach([this](KeyframeId id, const Keyframe& keyframe) { Add(id, keyframe); });
  }
}

void Visits::Add(KeyframeId id, const Keyframe& keyframe) {
  if (id <= last_) return;
  if (keyframe.features->frame < last_frame_) begins_.push_back(id);
  last_ = id;
  last_frame_ = keyframe.features->frame;
}

int Visits::Of(KeyframeId id) const {
  return static_cast<int>(std::upper_bound(begins_.begin(), begins_.end(), id) - begins_.begin());
}

int ObserverLevels::Of(const Map& map, LandmarkId id) {
  const auto index = static_cast<size_t>(id.value);
  if (index >= levels_.size()) levels_.resize(static_cast<size_t>(map.landmarks().end_id()), kUnknownLevel);
  uint8_t& level = levels_[index];
  if (level != kUnknownLevel) return level;
  std::array<int, std::numeric_limits<uint8_t>::max() + 1> num_at{};
  for (const Observation& observation : map.ObservationsOf(id)) {
    ++num_at[map.FindKeyframe(observation.keyframe)->features->keypoints[Index(observation.keypoint)].level];
  }
  int num_observers = 0;
  for (level = 0; level < kNoLevel; ++level) {
    num_observers += num_at[level];
    if (num_observers >= n_) break;
  }
  return level;
}

void ObserverLevels::Forget(LandmarkId id) {
  const auto index = static_cast<size_t>(id.value);
  if (index < levels_.size()) levels_[index] = kUnknownLevel;
}

// A keyframe is an observer itself.
KeyframeCuller::KeyframeCuller(const KeyframeCullingOptions& options)
    : options_(options), levels_(options.redundant_observers + 1) {}

void KeyframeCuller::Cull(KeyframeId center, RemovedKeyframes& removed, MapEditor& editor) {
  const Map& map = editor.map();
  visits_.Update(map, center);
  for (const LandmarkId id : editor.reobserved_landmarks().Ids()) levels_.Forget(id);
  const std::set<KeyframeId> closed_a_loop = KeyframesOfLoops(map);
  for (const KeyframeId id : map.Covisible(center, std::numeric_limits<int>::max())) {
    const bool must_stay = closed_a_loop.contains(id) || !map.FindKeyframe(id)->parent.valid();
    if (must_stay || id.value > center.value - options_.kept_newest || !IsRedundant(map, id)) continue;
    Remove(id, removed, editor);
  }
}

bool KeyframeCuller::IsRedundant(const Map& map, KeyframeId id) {
  const int visit = visits_.Of(id);
  const bool can_others_stand_in =
      visit == visits_.newest()
          ? HoldsForMost(*map.FindKeyframe(id), options_.redundant_share,
                         [&](LandmarkId landmark, int level) { return levels_.Of(map, landmark) <= level + 1; })
          : CanStandIn(map, visits_, {visit, options_.redundant_observers, options_.redundant_share}, id);
  if (can_others_stand_in) return true;
  return visit > 0 && CanStandIn(map, visits_, {visit - 1, 1, options_.known_share}, id) &&
         NeighborsHoldWithout(map, id, options_.min_tie);
}

void KeyframeCuller::Remove(KeyframeId id, RemovedKeyframes& removed, MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(id);
  for (const LandmarkId landmark : keyframe.landmarks) {
    if (landmark.valid()) levels_.Forget(landmark);
  }
  const KeyframeId parent = keyframe.parent;
  map.keyframes().ForEach([&](KeyframeId child, const Keyframe& other) {
    if (other.parent == id) editor.SetParent(child, parent);
  });
  removed.Remember(map, id);
  editor.RemoveKeyframe(id);
}

}  // namespace tessera
