// What goes to the mapper of a frame that becomes a keyframe, and what the tracker knows of it until the mapper
// answers.
#pragma once

#include "measurement/depth_points.h"
#include "messages/tracking_types.h"
#include "tracking/map_replica.h"
#include "tracking/reference_keyframe.h"

namespace tessera {

// `given`: the camera as the source brings it. The mapper may have found other focal lengths since; keypoints stay
// where the lens of the frame's view moved them.
KeyframeObservation ObserveKeyframe(KeyframeId id, const LocalizedFrame& localized, const CameraCalibration& given,
                                    const ReferenceKeyframe& reference, const MapReplica& replica);

// A point as one view alone knows it, in the frame of its camera. `covariance`: of the point, if its depth isn't known
// by the view itself.
Landmark PointOf(const FrameView& view, int32_t keypoint, const Eigen::Vector3d& point_in_camera,
                 const Eigen::Matrix3d* covariance = nullptr);

// Stereo, RGB-D: keypoints with depth that see no known point are points of their own, which the frame sees now.
void AddDepthPoints(KeyframeId id, const DepthPointOptions& options, TrackedFrame& frame, SentKeyframe& sent);

// Mono, after a wide step, or where known points fade from the view of a vehicle: what this keyframe and its reference
// see is known by them, and the frame sees it now. At the next step it may be all that is left in view. After a wide
// step with few known points, the mapper gets these as well; where points fade, it gets those that a third view
// confirms. To be called before the keyframe becomes the reference.
//
// In a hand, a camera that sees next to nothing is better lost for some frames, and found again where much is known.
void AddPairPoints(const ReferenceKeyframe& reference, const MapReplica& replica, LocalizedFrame& localized,
                   KeyframeObservation& keyframe, SentKeyframe& sent);

}  // namespace tessera
