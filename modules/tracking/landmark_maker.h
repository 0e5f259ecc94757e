// New landmarks of a new keyframe, and the upkeep of those it sees.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tracking/epipolar_matching.h"
#include "tracking/odometry_map.h"

namespace tessera {

struct LandmarkOptions {
  int num_neighbours = 8;           // keyframes that new landmarks are triangulated with
  double min_baseline_share = 0.02; // of the scene's median depth: a neighbour nearer than that tells no depth
  double min_parallax_rad = 0.012;  // of a new landmark: about 5 px at a focal length of 450 px
  double min_depth_share = 0.15;    // of the scene's median depth: nothing nearer is looked for
  double max_depth_baselines = 40;  // stereo, RGB-D: up to here the right column alone makes a landmark
  int num_extended = 6;             // neighbours in which a new landmark is looked for besides
  double extend_radius_px = 4.0;    // search window for that, times the scale of the level
  int trial_keyframes = 2;          // a landmark must have enough sightings by the time that this many have come
  int min_sightings_after_trial = 3;  // mono. One less for landmarks with a right column
  double min_found_share = 0.25;    // of the frames in which it should have been seen
  MatchingOptions matching{50, 0.8, true};

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

// Makes landmarks of the keyframe's free keypoints that have a right column and are near enough. Returns how many.
int MakeLandmarksFromRight(OdometryMap& map, KeyframeId keyframe, const LandmarkOptions& options);

// Makes landmarks of free keypoints that match with a neighbour's along epipolar lines, looks for them in further
// neighbours, and merges them with landmarks that turn out to be the same. Returns how many were made.
int TriangulateLandmarks(OdometryMap& map, KeyframeId keyframe, const LandmarkOptions& options);

// Estimates each landmark that the keyframe sees anew from all its sightings, without those that disagree. A
// landmark that its sightings no longer fix is removed.
void RefineLandmarks(OdometryMap& map, KeyframeId keyframe);

// Removes young landmarks that did not prove themselves; see LandmarkOptions.
void CullLandmarks(OdometryMap& map, KeyframeId newest, const LandmarkOptions& options);

// Median depth of the landmarks that the keyframe sees; nullopt if there are none in front of it.
std::optional<double> MedianDepth(const OdometryMap& map, KeyframeId keyframe);

}  // namespace tessera
