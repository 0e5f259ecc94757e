#include "tracking/tracker_options.h"

namespace tessera {

std::string KeyframeOptions::Check() const {
  if (!(max_parallax_rad > 0.0) || !(min_parallax_rad > 0.0) || !(max_interval_s > 0.0)) {
    return "parallaxes and interval of keyframes must be positive";
  }
  if (!(min_seen_share > 0.0 && min_seen_share <= 1.0) || !(low_seen_share > 0.0 && low_seen_share <= 1.0)) {
    return "the shares of landmarks seen that make a keyframe due must lie between 0 and 1";
  }
  return "";
}

std::string TrackerOptions::Check() const {
  if (!(sigma_px > 0.0) || !(rgbd_baseline_m > 0.0) || !(wide_radius_factor >= 1.0)) {
    return "sigma_px and rgbd_baseline_m must be positive, wide_radius_factor at least 1";
  }
  if (num_local_keyframes < 1 || num_relocalization_keyframes < 1 || max_lost_frames < 1 || max_keyframes < 20) {
    return "numbers of frames and keyframes must be at least 1, max_keyframes at least 20";
  }
  for (const std::string& sentence : {search.Check(), keyframe.Check(), landmark.Check(), initializer.Check()}) {
    if (!sentence.empty()) {
      return sentence;
    }
  }
  return "";
}

}  // namespace tessera
