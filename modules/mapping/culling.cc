#include "mapping/culling.h"

#include <algorithm>
#include <limits>
#include <set>

#include "measurement/landmark_view.h"

namespace tessera {
namespace {

// Whether enough others see the landmark as well as `own` does.
bool IsWellSeen(const Map& map, LandmarkId landmark, KeyframeId own, int level, int min_observers) {
  int num_observers = 0;
  for (const Observation& observation : map.ObservationsOf(landmark)) {
    if (observation.keyframe == own) continue;
    const Keyframe& other = *map.FindKeyframe(observation.keyframe);
    num_observers += other.features->keypoints[static_cast<size_t>(observation.keypoint)].level <= level + 1 ? 1 : 0;
    if (num_observers >= min_observers) return true;
  }
  return false;
}

bool IsRedundant(const Map& map, KeyframeId id, const CullingOptions& options) {
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const auto num_landmarks = std::count_if(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                                           [](LandmarkId landmark) { return landmark.valid(); });
  const double min_well_seen = options.redundant_share * static_cast<double>(num_landmarks);
  auto num_well_seen = num_landmarks;  // but for those found not to be
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const LandmarkId landmark = keyframe.landmarks[i];
    if (!landmark.valid()) continue;
    const int level = keyframe.features->keypoints[i].level;
    num_well_seen -= IsWellSeen(map, landmark, id, level, options.redundant_observers) ? 0 : 1;
    if (static_cast<double>(num_well_seen) <= min_well_seen) return false;  // most keyframes, after a few landmarks
  }
  return num_landmarks > 0;
}

}  // namespace

std::string CullingOptions::Check() const {
  if (trial_keyframes < 1 || min_observations < 1) return "a landmark's trial needs at least one keyframe";
  if (num_witnesses < 1 || !(min_seen_share >= 0.0)) return "the mapper needs a witness for a new landmark at least";
  if (!(redundant_share > 0.0) || redundant_observers < 1 || kept_newest < 1) {
    return "the mapper's limits of redundant keyframes must be positive";
  }
  return "";
}

void LandmarkTrial::Add(KeyframeId born, const std::vector<LandmarkId>& landmarks) {
  for (const LandmarkId landmark : landmarks) {
    entries_.push_back({landmark, born});
  }
}

void LandmarkTrial::Judge(KeyframeId now, const CullingOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  std::erase_if(entries_, [&](const Entry& entry) {
    if (map.FindLandmark(entry.landmark) == nullptr) return true;
    const auto num_observations = static_cast<int>(map.ObservationsOf(entry.landmark).size());
    const int64_t age = now.value - entry.born.value;
    // Two are what it was born with; a third must come, at the latest one keyframe before the end of the trial.
    if (age >= options.trial_keyframes - 1 && num_observations < options.min_observations) {
      editor.RemoveLandmark(entry.landmark);
      return true;
    }
    return age >= options.trial_keyframes;
  });
}

void RemoveUnconfirmed(KeyframeId center, const std::vector<LandmarkId>& created, const CullingOptions& options,
                       MapEditor& editor) {
  const Map& map = editor.map();
  std::vector<View> views;
  for (const KeyframeId id : map.Covisible(center, options.num_witnesses)) {
    const Keyframe& keyframe = *map.FindKeyframe(id);
    views.emplace_back(keyframe.features->calibration, keyframe.world_from_camera);
  }
  for (const LandmarkId id : created) {
    const Landmark* landmark = map.FindLandmark(id);
    if (landmark == nullptr) continue;
    const auto num_expected = std::count_if(views.begin(), views.end(),
                                            [&](const View& view) { return Expect(view, *landmark).has_value(); });
    // The newest keyframe sees it in any case.
    const auto num_observations = static_cast<double>(map.ObservationsOf(id).size());
    if (num_observations < options.min_seen_share * static_cast<double>(num_expected + 1)) editor.RemoveLandmark(id);
  }
}

void CullKeyframes(KeyframeId center, const CullingOptions& options, RemovedKeyframes& removed, MapEditor& editor) {
  const Map& map = editor.map();
  std::set<KeyframeId> kept;
  for (const ClosedLoop& loop : map.closed_loops()) {
    kept.insert(loop.current);
    kept.insert(loop.matched);
  }
  for (const KeyframeId id : map.Covisible(center, std::numeric_limits<int>::max())) {
    if (kept.contains(id)) continue;
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
