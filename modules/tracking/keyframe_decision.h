// When a frame should become a keyframe: by how much of the reference is still seen, by how fast that falls, and by
// parallax. Never by whether somebody is busy.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tracking/point_matching.h"

namespace tessera {

struct KeyframeDecisionOptions {
  double min_share = 0.5;           // of the reference's points that must still be seen at the next frame
  double min_parallax_rad = 0.035;  // 2 degrees of median parallax to the reference: new points can be placed well
  double min_still_share = 0.9;     // parallax alone is no reason while more than this is still seen
  int min_points = 150;             // a frame that sees fewer known points becomes a keyframe if anything moved
  int64_t max_interval_us = 2000000;  // moving or not, not longer than this, if anything moved
  int min_new_points = 70;          // stereo, RGB-D: near keypoints that see no known point ...
  int max_known_points = 100;       // ... while fewer near keypoints than this see one

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

class KeyframeDecision {
 public:
  explicit KeyframeDecision(const KeyframeDecisionOptions& options) : options_(options) {}

  // `frame` became the reference.
  void Restart(const TrackedFrame& frame);
  // The reference's points got new names (MapReplica::Renew).
  void Renew(const MapReplica& replica);
  // `num_near_known`, `num_near_new`: near keypoints that see a known point, and that see none (mono: 0).
  bool Decide(const TrackedFrame& frame, int64_t frame_interval_us, const Rigid3& world_from_reference,
              int num_near_known, int num_near_new) const;

 private:
  const KeyframeDecisionOptions options_;
  int64_t utime_us_ = 0;
  std::vector<PointId> points_;  // that the reference saw, sorted
};

}  // namespace tessera
