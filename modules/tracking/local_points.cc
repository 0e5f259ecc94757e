#include "tracking/local_points.h"

#include <algorithm>

#include "map/neighborhood.h"

namespace tessera {
namespace {

constexpr int kMaxCovisible = 10;  // of each keyframe

}  // namespace

std::vector<KeyframeId> LocalKeyframes(const Map& map, const TrackedFrame& frame, int max_keyframes) {
  std::vector<LandmarkId> seen;
  for (const SeenPoint& point : frame.points) {
    if (point.id.landmark.valid()) seen.push_back(point.id.landmark);
  }
  const auto max_num = static_cast<size_t>(max_keyframes);
  std::vector<KeyframeId> keyframes = BestObservers(map, seen, {}, max_num * 2 / 3);
  const size_t num_best = keyframes.size();
  for (size_t i = 0; i < num_best; ++i) {
    for (const KeyframeId neighbor : map.Covisible(keyframes[i], kMaxCovisible)) {
      if (keyframes.size() >= max_num) return keyframes;
      if (std::find(keyframes.begin(), keyframes.end(), neighbor) == keyframes.end()) keyframes.push_back(neighbor);
    }
  }
  return keyframes;
}

KnownPoints LocalPoints(const MapReplica& replica, const TrackedFrame& frame, int max_keyframes) {
  const Map& map = replica.map();
  IdSet<LandmarkId> seen(map.landmarks().end_id());
  std::vector<PointId> seen_sent;  // sorted
  for (const SeenPoint& point : frame.points) {
    if (point.id.landmark.valid()) {
      seen.Add(point.id.landmark);
    } else if (point.valid()) {
      seen_sent.push_back(point.id);
    }
  }
  std::sort(seen_sent.begin(), seen_sent.end());
  const std::vector<LandmarkId> landmarks = LandmarksSeenBy(map, LocalKeyframes(map, frame, max_keyframes));
  KnownPoints points;
  points.reserve(landmarks.size());
  for (const LandmarkId id : landmarks) {
    if (!seen.Has(id)) points.emplace_back(PointId{id, {}, -1}, *map.FindLandmark(id));
  }
  for (const auto& [point, landmark] : replica.SentPoints()) {
    if (!std::binary_search(seen_sent.begin(), seen_sent.end(), point)) points.emplace_back(point, landmark);
  }
  return points;
}

}  // namespace tessera
