// The keyframe that frames are tracked from: the last one that was made, or that the camera was found at.
#pragma once

#include <cstdint>
#include <optional>

#include "messages/tracking_types.h"
#include "tracking/localized_frame.h"
#include "tracking/map_replica.h"
#include "tracking/motion_model.h"

namespace tessera {

struct ReferenceKeyframe {
  struct MotionAt {
    MotionModel model;
    int64_t utime_us = 0;
  };

  KeyframeId id;                               // invalid: none yet
  double scale = 1.0;                          // of its units, when the last frame was tracked or the map changed
  std::optional<TrackedFrame> frame;           // as it was when it became a keyframe; nullopt: it is the map's alone
  std::optional<MotionAt> motion;              // as it was then
  std::optional<PoseInfluences> influences{};  // by point: its own, or those of the first frame tracked from it

  // Identity before there is one.
  Sim3 WorldFromKeyframe(const MapReplica& replica) const { return replica.WorldFromKeyframe(id).value_or(Sim3{}); }
  // The map has changed: influences by the present names of their points.
  void RenewPoints(const MapReplica& replica);
  // Where a camera that turned so since the keyframe was made should be by how it moved then.
  MotionPrior ExpectAt(const Rigid3& reference_from_camera, int64_t utime_us) const;
  // Of the way from here to a frame with these influences. Both ends are as uncertain as their own frames' points leave
  // them.
  Matrix6d WayCovarianceTo(const TrackedFrame& other, const PoseInfluences& influences_on_other,
                           const Rigid3& world_from_reference);
};

// Of a frame that becomes the reference; nullopt: nothing is known of its error.
std::optional<PoseInfluences> InfluencesOnReference(const LocalizedFrame& localized, bool begins_part);

}  // namespace tessera
