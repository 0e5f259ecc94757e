#include "map/landmark_colors.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tessera {

std::vector<Rgb> ColorsAt(const std::vector<Keypoint>& keypoints, const ColorImage& image) {
  std::vector<Rgb> colors;
  if (image.empty()) return colors;
  colors.reserve(keypoints.size());
  const auto nearest = [](float position_px, int size_px) {
    return std::clamp(static_cast<int>(std::lround(position_px)), 0, size_px - 1);
  };
  for (const Keypoint& keypoint : keypoints) {
    colors.push_back(image.row(nearest(keypoint.y_px, image.height))[nearest(keypoint.x_px, image.width)]);
  }
  return colors;
}

void LandmarkColors::Receive(const ColorFrame& color) {
  answered_.insert(color.id);
  if (const auto keyframe = keyframes_.find(color.id); keyframe != keyframes_.end()) {
    Set(keyframe->second, color.image);
    keyframes_.erase(keyframe);
  } else if (!color.image.empty()) {
    images_[color.id] = color.image;
    if (images_.size() > kMaxImages) images_.erase(images_.begin());
  }
}

// Keyframes enter the map in the order of their frames: an image that is passed over has none.
void LandmarkColors::Receive(const MapDelta& delta) {
  if (delta.is_snapshot) return;
  for (const MapDelta::NewKeyframe& added : delta.new_keyframes) {
    const FrameId frame = added.features->frame;
    const Waiting keyframe{added.id, added.features};
    if (const auto image = images_.find(frame); image != images_.end()) {
      Set(keyframe, image->second);
    } else if (!answered_.contains(frame)) {
      keyframes_[frame] = keyframe;
    }
    images_.erase(images_.begin(), images_.upper_bound(frame));
  }
}

void LandmarkColors::Set(const Waiting& keyframe, const ColorImage& image) {
  if (!image.empty()) colors_[keyframe.id] = ColorsAt(keyframe.features->keypoints, image);
}

bool LandmarkColors::is_complete() const {
  return std::includes(answered_.begin(), answered_.end(), expected_.begin(), expected_.end());
}

std::optional<Rgb> LandmarkColors::Of(const ObservedLandmark& landmark) const {
  uint32_t red = 0, green = 0, blue = 0, num = 0;
  for (const Observation& observation : landmark.observations) {
    const auto found = colors_.find(observation.keyframe);
    if (found == colors_.end()) continue;
    const Rgb& color = found->second[static_cast<size_t>(observation.keypoint)];
    red += color.red;
    green += color.green;
    blue += color.blue;
    ++num;
  }
  if (num == 0) return std::nullopt;
  const auto mean = [num](uint32_t sum) { return static_cast<uint8_t>((sum + num / 2) / num); };
  return Rgb{mean(red), mean(green), mean(blue)};
}

}  // namespace tessera
