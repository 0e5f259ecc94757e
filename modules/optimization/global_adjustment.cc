#include "optimization/global_adjustment.h"

#include <algorithm>
#include <stdexcept>

#include "map/spanning_tree.h"
#include "optimization/local_adjustment.h"
#include "optimization/long_tracks.h"

namespace tessera {
namespace {

constexpr int kMaxObservers = 40;  // of a landmark, before they count as observers of several

LocalWindow WholePart(const Map& map, KeyframeId member) {
  LocalWindow window;
  window.inner = MapPartOf(map, member);
  map.landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    const std::span<const Observation> observations = map.ObservationsOf(id);
    if (observations.size() < 2) return;
    const bool is_inside = std::binary_search(window.inner.begin(), window.inner.end(), observations.front().keyframe);
    if (is_inside) window.landmarks.push_back(id);
  });
  return window;
}

}  // namespace

GlobalAdjustment AdjustGlobally(const Map& map, KeyframeId asked, const BundleOptions& options) {
  if (map.FindKeyframe(asked) == nullptr) throw std::invalid_argument("the keyframe to be adjusted is not in the map");
  GlobalAdjustment adjustment;
  adjustment.answers = asked;
  adjustment.delta = map.next_delta() - 1;
  const LocalWindow part = WholePart(map, asked);
  if (part.inner.size() < 2 || part.landmarks.empty()) return adjustment;
  BundleProblem problem = BuildLocalProblem(map, part, {});
  const size_t num_points = problem.points.size();
  SplitLongTracks(kMaxObservers, problem);
  const std::optional<BundleResult> result = AdjustBundle(problem, options);
  if (!result || !(result->final_cost < result->initial_cost)) return adjustment;
  adjustment.is_usable = true;
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    adjustment.poses.push_back({problem.poses[i].id, result->camera_from_world[i].Inverse()});
  }
  for (size_t i = 0; i < num_points; ++i) {
    adjustment.points.push_back({problem.points[i].id, result->positions_in_world[i]});
  }
  return adjustment;
}

GlobalAdjustment AdjustEveryPart(const Map& map, const BundleOptions& options) {
  GlobalAdjustment all;
  all.answers = map.answered();
  all.delta = map.next_delta() - 1;
  for (const KeyframeId root : Roots(map)) {
    const GlobalAdjustment part = AdjustGlobally(map, root, options);
    all.is_usable |= part.is_usable;
    all.poses.insert(all.poses.end(), part.poses.begin(), part.poses.end());
    all.points.insert(all.points.end(), part.points.begin(), part.points.end());
  }
  std::ranges::sort(all.poses, {}, &GlobalAdjustment::Pose::id);
  std::ranges::sort(all.points, {}, &GlobalAdjustment::Point::id);
  return all;
}

}  // namespace tessera
