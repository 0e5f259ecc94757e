// When a frame should become a keyframe: by how much of the reference is still seen, by how fast that falls, and by
// parallax; never by the load of the system.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "matching/point_matching.h"
#include "tracking/map_replica.h"

namespace tessera {

struct KeyframeDecisionOptions {
  // Of the reference's points that were found in the frame after it, this share must still be seen at the next frame.
  double min_share = 0.7;
  // The same where each keyframe has points of its own by their depth, and needs no second one that sees them.
  double min_share_with_depth = 0.61;
  // Of all the reference's points, this share must be found in the frame after it. Corners come and go: a loss of a
  // third from frame to frame is nothing to act on, a greater one is motion.
  double min_first_share = 0.4;
  double min_parallax_rad =
      0.035;  // mono: 2 degrees of median parallax to the reference: new points can be triangulated well
  // And the camera must not turn by more than this share of its field of view. Mono knows what comes into view at the
  // next frame only if this one and the reference both see it; with depth, what is left in view lies at one side of the
  // image, where a turn looks like a step aside.
  double max_turn_share = 0.4;
  double min_still_share = 0.9;       // few points, parallax or age is no reason while more than this is still seen
  int min_points = 150;               // a frame that sees fewer known points becomes a keyframe if anything moved
  int64_t max_interval_us = 2000000;  // not longer than this, if anything moved
  int min_new_points = 70;            // stereo, RGB-D: near keypoints that see no known point ...
  int max_known_points = 100;         // ... while fewer near keypoints than this see one

  Result<> Check() const;
};

class KeyframeDecision {
 public:
  explicit KeyframeDecision(const KeyframeDecisionOptions& options) : options_(options) {}

  // Near keypoints that see a known point, and that see none (stereo, RGB-D).
  struct NearKeypoints {
    int num_known = 0;
    int num_new = 0;
  };

  // `frame` became the reference.
  void Restart(const TrackedFrame& frame);
  // The delta that answered the reference may have renamed its points (MapReplica::Renew).
  void Renew(const MapReplica& replica);
  // To be asked of every tracked frame after the reference, in order. `frame_interval_us`: to the frame before.
  bool Decide(const TrackedFrame& frame, int64_t frame_interval_us, const Rigid3& world_from_reference,
              const NearKeypoints& near);

 private:
  // What the frame sees of the reference's points.
  struct Seen {
    std::vector<PointId> points;  // by keypoint
    double median_parallax_rad = 0.0;
  };
  Seen See(const TrackedFrame& frame, const Rigid3& world_from_reference) const;
  bool TurnsAway(const TrackedFrame& frame, const Rigid3& world_from_reference, int64_t frame_interval_us) const;
  double NextShare(double share, int64_t utime_us, int64_t frame_interval_us) const;

  const KeyframeDecisionOptions options_;
  int64_t utime_us_ = 0;                   // of the reference
  std::optional<int64_t> first_utime_us_;  // of the frame after it, once that was asked
  // Sorted: points of known depth that the reference saw; later, those of them that the frame after it saw.
  std::vector<PointId> points_;
};

}  // namespace tessera
