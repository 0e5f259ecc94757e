// Keypoints in messages: what FEATURES, KEYFRAME, RELOCALIZATION_REQUEST and the map's keyframes have in common.
#pragma once

#include <cstddef>

#include "features/feature_types.h"
#include "tessera/keypoints_t.hpp"
#include "wire/layout.h"

namespace tessera {

inline bool IsInRange(const Keypoint& keypoint, const CameraCalibration& camera) {
  return IsNearImage(keypoint, camera) && keypoint.level < kMaxLevels && keypoint.depth_m >= 0.0F;
}

template <class Fields, class Message, class Shift>
void DescribeRightShift(Fields& fields, Message& message, Shift& shift) {
  fields(message.right_shift[0], shift.center_px);
  fields(message.right_shift[1], shift.across_px);
  fields(message.right_shift[2], shift.down_px);
  fields(message.right_shift[3], shift.bend_px);
  fields.Check(IsRightShift(shift), "its right columns are moved too far");
}

// `more`: columns of the enclosing message with one item for each keypoint.
template <class Fields, class Message, class Frame, class... More>
void DescribeKeypoints(Fields& fields, Message& message, Frame& frame, More... more) {
  fields.Key(message.frame, frame.frame);
  fields.Time(message.utime, frame.utime_us);
  fields.Time(message.captured, frame.captured_us);
  fields(message.camera, frame.calibration);
  fields(message.radial, frame.calibration.radial);
  fields.Check(IsRadial(frame.calibration.radial), "its radial distortion is out of range");
  DescribeRightShift(fields, message, frame.calibration.right_shift);
  fields.Check(frame.frame.valid(), "its frame number is negative");
  auto& keypoints = frame.keypoints;
  fields.WholeTable(
      message.num_total, message.first, message.num_keypoints,
      [&](size_t i) { return IsInRange(keypoints[i], frame.calibration); },
      Column(message.x, keypoints, &Keypoint::x_px), Column(message.y, keypoints, &Keypoint::y_px),
      Column(message.level, keypoints, &Keypoint::level), Column(message.angle, keypoints, &Keypoint::angle),
      Column(message.score, keypoints, &Keypoint::score), Column(message.right_x, keypoints, &Keypoint::right_x_px),
      Column(message.depth_m, keypoints, &Keypoint::depth_m), Column(message.descriptors, frame.descriptors), more...);
}

template <>
struct Layout<keypoints_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& frame) {
    DescribeKeypoints(fields, message, frame);
  }
};

}  // namespace tessera
