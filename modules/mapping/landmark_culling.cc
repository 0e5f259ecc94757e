#include "mapping/landmark_culling.h"

#include <algorithm>

#include "measurement/landmark_view.h"

namespace tessera {

Result<> LandmarkCullingOptions::Check() const {
  if (recent_keyframes < 1 || min_observations < 1)
    return Failed("a landmark must be recent for at least one keyframe");
  if (num_checked_views < 1 || !(min_seen_share >= 0.0)) {
    return Failed("a new landmark must be checked in at least one keyframe");
  }
  return {};
}

void RecentLandmarks::Add(KeyframeId created_at, const std::vector<LandmarkId>& landmarks) {
  for (const LandmarkId landmark : landmarks) {
    entries_.push_back({landmark, created_at});
  }
}

void RecentLandmarks::Cull(KeyframeId now, const LandmarkCullingOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  for (const Entry& entry : entries_) {
    const auto num_observations = static_cast<int>(map.ObservationsOf(entry.landmark).size());
    // A pair created it; a third observation must come one keyframe before it counts as old.
    const bool must_be_seen = now.value - entry.created_at.value >= options.recent_keyframes - 1;
    if (must_be_seen && num_observations < options.min_observations && map.FindLandmark(entry.landmark) != nullptr) {
      editor.RemoveLandmark(entry.landmark);
    }
  }
  ForgetOld(now, options, map);
}

void RecentLandmarks::ForgetOld(KeyframeId now, const LandmarkCullingOptions& options, const Map& map) {
  std::erase_if(entries_, [&](const Entry& entry) {
    return map.FindLandmark(entry.landmark) == nullptr ||
           now.value - entry.created_at.value >= options.recent_keyframes;
  });
}

void RemoveUnconfirmed(KeyframeId center, const std::vector<LandmarkId>& created, const LandmarkCullingOptions& options,
                       MapEditor& editor) {
  const Map& map = editor.map();
  std::vector<View> views;
  for (const KeyframeId id : map.Covisible(center, options.num_checked_views)) {
    const Keyframe& keyframe = *map.FindKeyframe(id);
    views.emplace_back(keyframe.features->calibration, keyframe.world_from_camera);
  }
  for (const LandmarkId id : created) {
    const Landmark* landmark = map.FindLandmark(id);
    if (landmark == nullptr) continue;
    const auto num_expected = std::count_if(views.begin(), views.end(),
                                            [&](const View& view) { return Expect(view, *landmark).has_value(); });
    // The pair that made it says nothing: of the two, the newest keyframe is not among the views.
    const auto num_others = static_cast<double>(map.ObservationsOf(id).size()) - 2.0;
    if (num_others < options.min_seen_share * static_cast<double>(num_expected - 1)) editor.RemoveLandmark(id);
  }
}

}  // namespace tessera
