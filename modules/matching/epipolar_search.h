// The search along epipolar lines for second views of keypoints, between two views whose relative pose is known.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>

#include "core/result.h"
#include "features/feature_types.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"
#include "measurement/feature_grid.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {

struct EpipolarOptions {
  // Two views show the depth of a point if their rays' parallax is this many standard deviations. A point without
  // parallax is created too, far away: it holds the rotation, and how little is known of its depth stands in
  // Landmark::depth_sigma. If only points were created whose noise makes parallax, noise would become depth, and a bend
  // that the map has by mistake would be confirmed by all new points.
  double min_parallax_sigmas = 3.0;
  // And at least this share of the angle by which the camera turned between the views. Noise averages out over hundreds
  // of landmarks. What is systematic in the images (the rest of a lens distortion, a rolling shutter) does not, and
  // grows with the way that a keypoint makes through the image: an error of 1 % of the turn is one of 5 % of the depth.
  double min_parallax_per_turn = 0.2;
  int max_hamming = 50;             // bits of 256: what patches of one point differ by, nearly always
  double max_hamming_ratio = 0.85;  // best match to the second best along the line, elsewhere on it
  // How many keypoints on the line may be expected to look as much like the first by chance, by how many do elsewhere.
  double max_by_chance = 0.1;
  bool needs_far_end = true;  // no pair where a point at infinity would lie beside the second image; see below

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Looks near a keypoint's epipolar line, on the segment for depths from `min_depth` to infinity. A pair must agree in
// descriptor, orientation and level, and its point must lie in front of both cameras, project to both keypoints
// (chi-square), and have distances that fit the levels.
//
// What agrees may do so by chance, the more easily the more there is on the line and the more the image repeats itself:
// treetops, leaves, windows. Keypoints away from the line can't show the point, so they tell what chance does with this
// descriptor, in this image. If n keypoints on the line were looked at, and k of N elsewhere are as near as the match,
//
//   n (k + 0.2) / (N + 10)
//
// others would be found by chance: the number of false alarms (Desolneux, Moisan, Morel, "Meaningful Alignments", IJCV
// 2000). A fixed distance means another thing for each keypoint; stages/mapper/MEASUREMENTS.md has figures for both.
//
// Where the segment's far end lies beside the second image, a far point has no true match: what is found for it is
// false, and always too near. In an open bend, where skylines turn into view, most pairs were such ones, and the scale
// followed them. In a street, near walls stand there, and two pairs of three are true: so it can be switched off.
class EpipolarSearch {
 public:
  // The features must outlive the search. `is_free` says which keypoints of the second view take part; one that a
  // match has taken may stop being free.
  EpipolarSearch(const FeatureFrame& first, const FeatureFrame& second, const Rigid3& second_from_first,
                 std::function<bool(int32_t)> is_free, double min_depth, const EpipolarOptions& options);

  // The keypoint of the second view that sees the same point, and the point in the first camera's frame.
  struct Match {
    int32_t keypoint;
    Eigen::Vector3d point_in_first;
  };
  std::optional<Match> Find(int32_t keypoint) const;

 private:
  struct InverseDepths {
    double low;
    double high;
  };
  // A piece of an epipolar line in the second image, pixels.
  struct Segment {
    Eigen::Vector2d begin;
    Eigen::Vector2d end;
    Eigen::Vector2d direction;  // of length 1
    double length_px;
    // Whether the position is at most `limit_px` beside the segment and beyond its ends.
    bool IsNear(float x_px, float y_px, double limit_px) const;
  };
  struct Candidate {
    int32_t keypoint = -1;
    int distance = 257;  // bits
    int num_on_line = 0;
  };
  InverseDepths Bounds(const PixelObservation& seen) const;
  std::optional<Segment> LineOf(const PixelObservation& seen) const;
  PatchRange PatchesLike(const Keypoint& keypoint) const;
  std::optional<Candidate> BestOnLine(int32_t keypoint, const Segment& line) const;
  double NumByChance(int32_t keypoint, const Segment& line, const Candidate& found) const;
  std::optional<Eigen::Vector3d> Triangulate(const PixelObservation& in_first, const PixelObservation& in_second) const;
  std::optional<Eigen::Vector3d> FarPoint(const Eigen::Vector3d& ray, const Eigen::Vector3d& ray_in_second,
                                          double noise_rad) const;
  bool IsConsistent(const Eigen::Vector3d& point_in_first, const PixelObservation& in_first,
                    const PixelObservation& in_second) const;

  const EpipolarOptions options_;
  const FeatureFrame& first_;
  const FeatureFrame& second_;
  const CameraCalibration& calibration_;
  const double baseline_m_;
  const Rigid3 second_from_first_;
  const Eigen::Matrix3d rotation_;
  const uint8_t roll_;
  const double max_inverse_depth_;
  const double min_parallax_of_turn_;         // rad
  std::array<double, kMaxLevels> limits_px_;  // by level: how far from the line a keypoint may lie
  const std::function<bool(int32_t)> is_free_;
  const FeatureGrid grid_;  // of the keypoints of the second view that were free at first
};

}  // namespace tessera
