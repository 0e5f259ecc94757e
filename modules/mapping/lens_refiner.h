// Corrects the focal lengths and the distortion of a mono camera by the map. An error of a percent is usual even where
// a camera was calibrated with care. One of the focal length costs little while the camera goes straight; but each turn
// then changes the scale of the map, by 10 % in one of 90 degrees with an error of 2 % (KITTI 03). One of the
// distortion changes it everywhere, as points come nearer and move outward.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "map/map_editor.h"
#include "optimization/lens_estimation.h"

namespace tessera {

// Looks at the newest keyframes from time to time, where the camera has turned. Two looks in a row that agree are
// needed to change anything.
class LensRefiner {
 public:
  // A look takes in as many landmarks, those that most of the keyframes observe.
  explicit LensRefiner(size_t max_landmarks = 1500) : max_landmarks_(max_landmarks) {}

  // To be called before keyframe `next` is added; `given`: the calibration of the source. Where the lens changes, the
  // newest keyframes and their landmarks are adjusted to it, and the answer is true.
  bool Refine(KeyframeId next, const CameraCalibration& given, MapEditor& editor);

  // By which share of the given focal lengths the map's differ from them, found here or before the map was loaded.
  double error() const { return error_; }
  // Likewise what was found but not used, since no calibration is as wrong as that; 0: nothing.
  double doubt() const { return doubt_; }

 private:
  bool Change(const LensError& error, const std::vector<KeyframeId>& keyframes, MapEditor& editor);

  size_t max_landmarks_;
  KeyframeId next_look_;
  int64_t interval_ = 0;                 // keyframes between looks
  std::optional<FocalEstimate> before_;  // what the last look found, if it was a clear error
  double error_ = 0.0;
  double doubt_ = 0.0;
};

}  // namespace tessera
