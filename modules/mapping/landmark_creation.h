// Landmark creation at a new keyframe: from the depth of its keypoints, and by triangulation with other keyframes.
#pragma once

#include <vector>

#include "core/result.h"
#include "map/map_editor.h"

namespace tessera {

struct CreationOptions {
  int max_neighbors = 10;  // keyframes searched for a second view, most shared landmarks first
  // Two views show the depth of a point if their rays' parallax is this many standard deviations. A point without
  // parallax is created too, far away: it holds the rotation, and how little is known of its depth stands in
  // Landmark::depth_sigma. If only points were created whose noise makes parallax, noise would become depth, and a bend
  // that the map has by mistake would be confirmed by all new points.
  double min_parallax_sigmas = 3.0;
  // And at least this share of the angle by which the camera turned between the views. Noise averages out over hundreds
  // of landmarks. What is systematic in the images (the rest of a lens distortion, a rolling shutter) does not, and
  // grows with the way that a keypoint makes through the image: an error of 1 % of the turn is one of 5 % of the depth.
  double min_parallax_per_turn = 0.2;
  double min_baseline_share = 0.01;  // mono: a neighbor must be this part of the median depth away
  int max_hamming = 50;              // bits of 256: what patches of one point differ by, nearly always
  double max_hamming_ratio = 0.85;   // best match to the second best along the line, elsewhere on it
  double max_depth_baselines =
      40.0;                    // a depth of up to this many baselines is good enough by itself (ORB-SLAM2: 35, 40)
  int min_depth_points = 100;  // the nearest so many keypoints become landmarks at any depth

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Creates landmarks from keypoints of `keyframe` that have depth and observe no landmark yet. Returns them.
std::vector<LandmarkId> CreateFromDepth(KeyframeId keyframe, const CreationOptions& options, MapEditor& editor);

// Creates landmarks from pairs of keypoints that observe none yet, one in `keyframe` and one in a covisible keyframe
// near the first's epipolar line there: the segment for depths from a third of the nearest landmarks' to infinity.
// A pair must agree in descriptor, orientation and level, and its point must lie in front of both, project to both
// keypoints (chi-square), and have distances that fit the levels. Returns the new ones.
std::vector<LandmarkId> CreateFromPairs(KeyframeId keyframe, const CreationOptions& options, MapEditor& editor);

}  // namespace tessera
