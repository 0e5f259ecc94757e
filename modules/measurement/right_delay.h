// The right camera of a stereo pair that isn't triggered together with the left one takes its image a little before or
// after it. While the camera moves, it sees a point in another column than it would have, so disparities are wrong.
#pragma once

#include "features/feature_types.h"
#include "measurement/rolling_shutter.h"

namespace tessera {

// How the column at which the right camera sees a point of the left camera's frame changes while they move so, px/s:
//
//   u_right = fx (x - baseline) / z + cx,    d(point)/dt = -PointVelocity
double RightColumnRate(const CameraCalibration& camera, const Eigen::Vector3d& point_in_left,
                       const CameraMotion& motion);

// The features with the columns that the right camera would have seen at their time, from those that it saw `delay_s`
// later (< 0: before). The depth of a keypoint is where its ray meets the column's plane of rays of the right camera at
// its time: with ray r, w = 1 / depth, later_from_now = (R, t) and the column m on the right camera's plane z = 1,
//
//   (a - w c) ~ (m, ., 1),    a = R r,  c = (baseline, 0, 0) - t    =>    w = (a_x - m a_z) / (c_x - m c_z)
//
// A keypoint whose rays part has no right column then; if it's by no more than the noise, it is as good as infinitely
// far.
FeatureFrame WithRightColumnsOfImage(const FeatureFrame& features, double delay_s, const CameraMotion& motion);

}  // namespace tessera
