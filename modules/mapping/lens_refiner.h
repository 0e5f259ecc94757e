// Corrects by the map what a camera's calibration says wrongly.
//
// Of a mono camera, the focal lengths and the distortion. An error of a percent is usual even where a camera was
// calibrated with care. One of the focal length costs little while the camera goes straight; but each turn then changes
// the scale of the map, by 10 % in one of 90 degrees with an error of 2 % (KITTI 03). One of the distortion changes it
// everywhere, as points come nearer and move outward.
//
// Of a stereo pair, where columns of the right image stand: bolts give way, and cameras warm up. A right camera that
// squints by a hundredth of a degree, a tenth of a pixel, bends a drive of 250 m by 0.2 m; nothing else shows it.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "map/map_editor.h"
#include "optimization/lens_estimation.h"
#include "optimization/right_image_estimation.h"

namespace tessera {

// Looks at the newest keyframes from time to time. Of one camera, which must have turned, two looks in a row have to
// agree before anything is changed; of a pair, looks are added up until the error is beyond doubt.
class LensRefiner {
 public:
  // A look takes in as many landmarks, those that most of the keyframes observe; with two cameras a third of them.
  explicit LensRefiner(size_t max_landmarks = 1500) : max_landmarks_(max_landmarks) {}

  // To be called before keyframe `next` is added; `given`: the calibration of the source. Where the lens changes, the
  // newest keyframes and their landmarks are adjusted to it, and the answer is true.
  bool Refine(KeyframeId next, const CameraCalibration& given, MapEditor& editor);

  // By which share of the given focal lengths the map's differ from them, found here or before the map was loaded.
  double error() const { return error_; }
  // Likewise what was found but not used, since no calibration is as wrong as that; 0: nothing.
  double doubt() const { return doubt_; }
  // Likewise the largest number of a shift of right columns, px.
  double right_shift_doubt_px() const { return right_shift_doubt_px_; }

 private:
  bool RefineFocal(const CameraCalibration& given, const std::vector<KeyframeId>& keyframes, MapEditor& editor);
  bool RefineRightImage(const CameraCalibration& given, const std::vector<KeyframeId>& keyframes, MapEditor& editor);
  // After a look: the next one is soon if this one found an error.
  void Plan(bool is_error);
  // Adjusts the keyframes to the problem's calibration, and gives it to the map.
  bool Change(const BundleProblem& problem, const LensCorrection& lens, MapEditor& editor);

  size_t max_landmarks_;
  KeyframeId looked_, next_look_;
  int64_t min_interval_ = 0, interval_ = 0;  // keyframes between looks
  std::optional<FocalEstimate> before_;      // what the last look found, if it was a clear error
  // What the looks since the last large change say of the whole shift, and calibrations as such.
  std::optional<RightShiftEquations> right_shift_;
  int num_right_looks_ = 0;
  KeyframeId newest_looked_at_;  // among them
  double error_ = 0.0;
  double doubt_ = 0.0;
  double right_shift_doubt_px_ = 0.0;
};

}  // namespace tessera
