#include "tracking/local_points.h"

#include <algorithm>
#include <map>
#include <utility>

#include "map/neighborhood.h"

namespace tessera {
namespace {

constexpr int kMaxCovisible = 10;  // of each keyframe

}  // namespace

std::vector<KeyframeId> LocalKeyframes(const Map& map, const TrackedFrame& frame, int max_keyframes) {
  std::map<KeyframeId, int> num_shared;
  for (const SeenPoint& point : frame.points) {
    for (const Observation& observation : map.ObservationsOf(point.id.landmark)) ++num_shared[observation.keyframe];
  }
  std::vector<std::pair<int, KeyframeId>> ranked;
  for (const auto& [id, count] : num_shared) ranked.emplace_back(-count, id);
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), static_cast<size_t>(max_keyframes) * 2 / 3));
  std::vector<KeyframeId> keyframes;
  for (const auto& [count, id] : ranked) keyframes.push_back(id);
  for (const auto& [count, id] : ranked) {
    for (const KeyframeId neighbor : map.Covisible(id, kMaxCovisible)) {
      if (static_cast<int>(keyframes.size()) >= max_keyframes) return keyframes;
      if (std::find(keyframes.begin(), keyframes.end(), neighbor) == keyframes.end()) keyframes.push_back(neighbor);
    }
  }
  return keyframes;
}

KnownPoints LocalPoints(const MapReplica& replica, const TrackedFrame& frame, int max_keyframes) {
  const Map& map = replica.map();
  std::vector<PointId> seen;
  for (const SeenPoint& point : frame.points) {
    if (point.valid()) seen.push_back(point.id);
  }
  std::sort(seen.begin(), seen.end());
  const auto is_seen = [&](const PointId& point) { return std::binary_search(seen.begin(), seen.end(), point); };
  KnownPoints points;
  for (const LandmarkId id : LandmarksSeenBy(map, LocalKeyframes(map, frame, max_keyframes))) {
    const PointId point{id, {}, -1};
    if (!is_seen(point)) points.emplace_back(point, *map.FindLandmark(id));
  }
  for (auto& [point, landmark] : replica.SentPoints()) {
    if (!is_seen(point)) points.emplace_back(point, landmark);
  }
  return points;
}

}  // namespace tessera
