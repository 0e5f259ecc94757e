// What one keyframe measured of space: points in its camera frame, to each of which its rays go.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/camera_frame.h"
#include "map/map.h"
#include "occupancy/occupancy_options.h"

namespace tessera {

struct ScanPoint {
  Eigen::Vector3d in_camera;  // m (mono: units of the map)
  Rgb color;
};

// Three bytes for each pixel that is kept, five with color, whose rays are no farther apart than a voxel at the maximum
// range; or a few hundred landmarks.
struct Scan {
  CameraCalibration camera;
  int stride_px = 1;                                 // kept are the pixels (i, j) * stride_px
  double depth_unit_m = 0.0;                         // of `depth`
  DepthImage depth;                                  // at these pixels; 0: unknown
  GrayImage intensity;                               // likewise, if its color is not known
  ColorImage color;                                  // likewise, if it is
  std::vector<Eigen::Vector3d> landmarks_in_camera;  // mono; then there are no images
  std::vector<Rgb> landmark_colors;                  // of each, or empty: not known

  bool operator==(const Scan&) const = default;
  bool is_colored() const { return !color.empty() || !landmark_colors.empty(); }
};

// From the depth image of an RGB-D frame, or from the two images of a stereo frame by semi-global matching of
// disparities up to `max_disparity_px` (H. Hirschmueller, "Stereo Processing by Semiglobal Matching and Mutual
// Information", PAMI 2008; OpenCV's StereoSGBM, in integers). The frame's images must have the camera's size, as must
// `color`, its left image in color; empty: that is gray.
Scan ScanFromImages(const CameraFrame& frame, const ColorImage& color, const CameraCalibration& camera,
                    const OccupancyOptions& options, int max_disparity_px);

// From the landmarks that a keyframe observes, in the order of its keypoints. `colors`: of its keypoints; empty: not
// known.
Scan ScanFromLandmarks(const Map& map, const Keyframe& keyframe, const std::vector<Rgb>& colors);

// How far before and behind its point a surface may be that a scan of this camera sees at this distance, m: twice the
// standard deviation of the depth of stereo,
//
//   sigma_z = z^2 / (f b) * sigma_d,   sigma_d = 0.25 px
//
// in which the distance stands for z. 0 for other sensors, whose errors are below a voxel.
double UncertaintyAt(double distance, const CameraCalibration& camera);

// The points of a scan, in a fixed order.
std::vector<ScanPoint> PointsOf(const Scan& scan);

}  // namespace tessera
