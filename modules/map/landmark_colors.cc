#include "map/landmark_colors.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

namespace tessera {
namespace {

size_t BytesOf(const ColorFrame& color) { return sizeof(Rgb) * color.image.pixels.size(); }

}  // namespace

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
    Set(keyframe->second, color);
    keyframes_.erase(keyframe);
  } else if (!color.image.empty() && images_.try_emplace(color.id, color).second) {
    image_bytes_ += BytesOf(color);
    while (image_bytes_ > kMaxImageBytes) DropImagesBefore(std::next(images_.begin()));
  }
}

// Keyframes enter the map in the order of their frames: an image that is passed over has none. A snapshot may begin
// with those of a loaded map, whose numbers are others.
void LandmarkColors::Receive(const MapDelta& delta) {
  if (delta.is_snapshot && !joins_late_) return;
  for (const MapDelta::NewKeyframe& added : delta.new_keyframes) {
    const FrameId frame = added.features->frame;
    const Waiting keyframe{added.id, added.features};
    if (const auto image = images_.find(frame); image != images_.end()) {
      Set(keyframe, image->second);
    } else if (!answered_.contains(frame)) {
      keyframes_[frame] = keyframe;
    }
    if (!delta.is_snapshot) DropImagesBefore(images_.upper_bound(frame));
  }
}

// A keyframe of a loaded map may have the same number, but was taken at another time.
void LandmarkColors::Set(const Waiting& keyframe, const ColorFrame& color) {
  if (color.image.empty() || color.utime_us != keyframe.features->utime_us) return;
  colors_[keyframe.id] = ColorsAt(keyframe.features->keypoints, color.image);
}

void LandmarkColors::DropImagesBefore(std::map<FrameId, ColorFrame>::iterator end) {
  for (auto it = images_.begin(); it != end; it = images_.erase(it)) image_bytes_ -= BytesOf(it->second);
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
