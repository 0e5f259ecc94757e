#include "mapping/keyframe_culling.h"

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <utility>
#include <vector>

namespace tessera {
namespace {

constexpr uint8_t kUnknownLevel = 255, kNoLevel = 254;

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

int ObserverLevels::Of(const Map& map, const Visits& visits, LandmarkId id) {
  const auto index = static_cast<size_t>(id.value);
  if (index >= levels_.size()) levels_.resize(static_cast<size_t>(map.landmarks().end_id()), kUnknownLevel);
  uint8_t& level = levels_[index];
  if (level != kUnknownLevel) return level;
  std::array<int, std::numeric_limits<uint8_t>::max() + 1> num_at{};
  for (const auto& [keyframe, keypoint] : map.ObservationsOf(id)) {
    if (visits.Of(keyframe) > last_visit_) continue;
    ++num_at[map.FindKeyframe(keyframe)->features->keypoints[Index(keypoint)].level];
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

KeyframeCuller::KeyframeCuller(const KeyframeCullingOptions& options) : options_(options) {}

void KeyframeCuller::Cull(KeyframeId center, RemovedKeyframes& removed, MapEditor& editor) {
  CullUpTo({center.value - options_.kept_newest}, center, removed, editor);
}

void KeyframeCuller::CullLast(KeyframeId center, RemovedKeyframes& removed, MapEditor& editor) {
  CullUpTo({center.value - 1}, center, removed, editor);
}

void KeyframeCuller::CullUpTo(KeyframeId last, KeyframeId center, RemovedKeyframes& removed, MapEditor& editor) {
  const Map& map = editor.map();
  visits_.Update(map, center);
  for (const LandmarkId id : editor.reobserved_landmarks().Ids()) Forget(id);
  const std::set<KeyframeId> closed_a_loop = KeyframesOfLoops(map);
  for (const KeyframeId id : map.Covisible(center, std::numeric_limits<int>::max())) {
    const bool must_stay = closed_a_loop.contains(id) || !map.FindKeyframe(id)->parent.valid();
    if (must_stay || id > last || !IsRedundant(map, id)) continue;
    Remove(id, removed, editor);
  }
}

void KeyframeCuller::Follow(KeyframeId center, const Map& map) {
  visits_.Update(map, center);
  levels_.clear();
}

bool KeyframeCuller::IsRedundant(const Map& map, KeyframeId id) {
  const int visit = visits_.Of(id);
  // It is an observer of its landmarks itself.
  if (AreObserved(map, id, options_.redundant_share, options_.redundant_observers + 1, visit)) return true;
  return visit > 0 && AreObserved(map, id, options_.known_share, 1, visit - 1) &&
         NeighborsHoldWithout(map, id, options_.min_tie);
}

// Whether so many keyframes of the first visits observe more than this share of the keyframe's landmarks, at its level
// or a finer one.
bool KeyframeCuller::AreObserved(const Map& map, KeyframeId id, double share, int num_observers, int last_visit) {
  const auto key = std::pair(num_observers, last_visit);
  ObserverLevels& levels = levels_.try_emplace(key, num_observers, last_visit).first->second;
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const auto num_landmarks =
      std::ranges::count_if(keyframe.landmarks, [](LandmarkId landmark) { return landmark.valid(); });
  const double min_observed = share * static_cast<double>(num_landmarks);
  auto num_observed = num_landmarks;  // an upper bound until the loop ends
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const LandmarkId landmark = keyframe.landmarks[i];
    if (!landmark.valid()) continue;
    const int level = keyframe.features->keypoints[i].level;
    num_observed -= levels.Of(map, visits_, landmark) <= level + 1 ? 0 : 1;
    if (static_cast<double>(num_observed) <= min_observed) return false;  // most, after a few landmarks
  }
  return num_landmarks > 0;
}

void KeyframeCuller::Forget(LandmarkId id) {
  for (auto& [key, levels] : levels_) levels.Forget(id);
}

void KeyframeCuller::Remove(KeyframeId id, RemovedKeyframes& removed, MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(id);
  for (const LandmarkId landmark : keyframe.landmarks) {
    if (landmark.valid()) Forget(landmark);
  }
  const KeyframeId parent = keyframe.parent;
  map.keyframes().ForEach([&](KeyframeId child, const Keyframe& other) {
    if (other.parent == id) editor.SetParent(child, parent);
  });
  removed.Remember(map, id);
  editor.RemoveKeyframe(id);
}

}  // namespace tessera
