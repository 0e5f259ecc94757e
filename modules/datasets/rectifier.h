// Makes images of real cameras into images of the pinhole that all later stages assume (geometry/camera.h):
// without distortion and, for a pair, with epipolar lines along the rows.
//
// Mono, RGB-D: the same camera without distortion; focal lengths, in their old ratio, and principal point
// chosen so that no pixel looks outside the original image. Stereo: Bouguet's rectification
// (cv::stereoRectify), cropped likewise. A fisheye lens sees more than a pinhole can show: the middle of the image
// keeps its resolution, and what lies too far aside is cut off (with a focal length of half the width: beyond 45
// degrees). Intensities are interpolated, depth counts are not (remap_table.h).
#pragma once

#include <memory>

#include "core/image.h"
#include "datasets/camera_rig.h"

namespace tessera {

class RemapTable;

class Rectifier {
 public:
  // `rig` must pass its Check for `sensor`, with the image size known. Throws InputError if the right camera
  // of the pair does not stand to the right.
  Rectifier(const CameraRig& rig, SensorType sensor);
  ~Rectifier();
  Rectifier(const Rectifier&) = delete;
  Rectifier& operator=(const Rectifier&) = delete;

  // What the images are after rectification.
  const CameraCalibration& calibration() const { return calibration_; }
  // Pose of the rectified camera in the frame of the original left camera: a rotation.
  const Rigid3& left_from_rectified() const { return left_from_rectified_; }
  // Whether images pass unchanged.
  bool is_identity() const { return left_ == nullptr; }

  // Images must have the rig's size.
  GrayImage Left(GrayImage image) const;
  ColorImage LeftColor(ColorImage image) const;
  GrayImage Right(GrayImage image) const;
  DepthImage Depth(DepthImage image) const;

 private:
  void PrepareSingle(const CameraRig& rig);
  void PreparePair(const CameraRig& rig);

  CameraCalibration calibration_;
  Rigid3 left_from_rectified_;
  std::unique_ptr<RemapTable> left_, right_;  // null: images pass unchanged
};

}  // namespace tessera
