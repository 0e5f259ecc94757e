// The pose of a camera from points whose position in the world is known, without an initial guess.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace tessera {

struct PointPixel {
  Eigen::Vector3d point_in_world;
  Eigen::Vector2d pixel_px;
  double sigma_px = 1.0;
};

// Poses camera_from_world that put three points on three rays (Grunert 1841, in the form of Haralick et al. 1994):
// up to four, fewer if some are complex or behind the camera, none if the points lie on a line. Rays need no unit
// length.
std::vector<Rigid3> PosesFromThreePoints(const std::array<Eigen::Vector3d, 3>& points_in_world,
                                         const std::array<Eigen::Vector3d, 3>& rays_in_camera);

struct AbsolutePoseOptions {
  int ransac_iterations = 200;  // three good of three are met with 99 % even at 30 % good matches
  int min_inliers = 12;         // fewer may agree by chance
  int max_refinements = 5;
};

struct AbsolutePose {
  Rigid3 camera_from_world;
  std::vector<char> is_inlier;  // by point
  int num_inliers = 0;
};

// RANSAC over triples; the winner has most points within the chi-square limit of their pixel. Three pixels fix a pose
// to some of their noise only, so it is refined over all that agree, as long as that makes more agree (locally
// optimized RANSAC, Chum et al. 2003). nullopt if these are fewer than min_inliers. `seed` decides the samples.
std::optional<AbsolutePose> EstimateAbsolutePose(const CameraCalibration& calibration,
                                                 std::span<const PointPixel> points, uint64_t seed,
                                                 const AbsolutePoseOptions& options);

}  // namespace tessera
