// What landmarks look like: what the color images of keyframes show at the keypoints that observe them. Nothing of it
// is part of the map, which is the same whether or not colors are known.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "core/image.h"
#include "geometry/camera_frame.h"
#include "map/map.h"

namespace tessera {

// The color of the pixel in which each keypoint lies, or of the nearest one; none if the image is empty.
std::vector<Rgb> ColorsAt(const std::vector<Keypoint>& keypoints, const ColorImage& image);

class LandmarkColors {
 public:
  // `joins_late`: keyframes of a snapshot may be of this run. Otherwise they are of a loaded map and have no colors.
  explicit LandmarkColors(bool joins_late = false) : joins_late_(joins_late) {}

  // This frame became a keyframe: its color will come.
  void Expect(FrameId frame) { expected_.insert(frame); }
  // An empty one says that there is none.
  void Receive(const ColorFrame& color);
  // A change of the map.
  void Receive(const MapDelta& delta);

  // Whether all that was expected has come.
  bool is_complete() const;
  // Whether any color is known.
  bool empty() const { return colors_.empty(); }
  // The mean over the observers whose colors are known; nullopt if none is.
  std::optional<Rgb> Of(const ObservedLandmark& landmark) const;

  // Images that wait for their keyframe to enter the map, more than a camera keeps for who comes late; of more, the
  // oldest are dropped.
  static constexpr size_t kMaxImageBytes = size_t{128} << 20;

 private:
  struct Waiting {
    KeyframeId id;
    std::shared_ptr<const FeatureFrame> features;
  };
  void Set(const Waiting& keyframe, const ColorFrame& color);
  void DropImagesBefore(std::map<FrameId, ColorFrame>::iterator end);

  bool joins_late_;
  std::set<FrameId> expected_, answered_;
  std::map<FrameId, ColorFrame> images_;  // whose keyframes are not in the map yet
  size_t image_bytes_ = 0;
  std::map<FrameId, Waiting> keyframes_;           // whose colors did not come yet
  std::map<KeyframeId, std::vector<Rgb>> colors_;  // by keypoint
};

}  // namespace tessera
