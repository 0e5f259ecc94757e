#include "map/neighborhood.h"

#include <algorithm>

namespace tessera {

std::vector<KeyframeId> KeyframesAround(const Map& map, KeyframeId id, int max_num) {
  std::vector<KeyframeId> around = map.Covisible(id, max_num);
  around.insert(around.begin(), id);
  return around;
}

std::vector<LandmarkId> LandmarksSeenBy(const Map& map, std::span<const KeyframeId> keyframes) {
  std::vector<LandmarkId> landmarks;
  for (const KeyframeId id : keyframes) {
    for (const LandmarkId landmark : map.FindKeyframe(id)->landmarks) {
      if (landmark.valid()) landmarks.push_back(landmark);
    }
  }
  std::sort(landmarks.begin(), landmarks.end());
  landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
  return landmarks;
}

}  // namespace tessera
