// Everything that decides how a tracker works.
#pragma once

#include <string>

#include "tracking/initializer.h"
#include "tracking/landmark_maker.h"
#include "tracking/pose_search.h"

namespace tessera {

// When a frame becomes a keyframe. No answer depends on anything but the frames.
struct KeyframeOptions {
  double max_parallax_rad = 0.05;   // due when the median landmark is seen from a direction changed by this much,
  double min_seen_share = 0.75;     // when fewer landmarks are seen than this share of the most since the last one,
  double max_interval_s = 1.0;      // or this long after the last one;
  double min_parallax_rad = 0.005;  // the latter two not before this much parallax, which new landmarks need,
  double low_seen_share = 0.4;      // unless the share sank below this: the camera turns away from all it knows

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

struct TrackerOptions {
  double sigma_px = 1.0;         // standard deviation of a keypoint's coordinates at level 0
  double rgbd_baseline_m = 0.08; // between projector and camera of the usual structured-light depth cameras
  PoseSearchOptions search;
  double wide_radius_factor = 3.0;       // search window when the prediction was no good, times the usual one
  int num_local_keyframes = 15;          // whose landmarks are looked for in each frame
  int num_relocalization_keyframes = 4;  // tried at each frame while lost
  int max_lost_frames = 10;  // after as many without a pose, a new part of the map is begun where the last pose was
  int max_keyframes = 500;   // older ones are forgotten, so that memory stays bounded
  KeyframeOptions keyframe;
  LandmarkOptions landmark;
  InitializerOptions initializer;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

}  // namespace tessera
