// FEATURES, POSE, KEYFRAME.
#include <algorithm>
#include <functional>

#include "messages/tracking_types.h"
#include "tessera/features_t.hpp"
#include "tessera/keyframe_t.hpp"
#include "tessera/pose_t.hpp"
#include "wire/codec_impl.h"
#include "wire/keypoints_layout.h"

namespace tessera {

template <>
inline constexpr TrackingState kLastEnumerator<TrackingState> = TrackingState::kLost;

template <>
struct Layout<features_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& frame) {
    fields.Time(message.depth_delay, frame.depth_delay_us);
    fields(message.keypoints, frame);
  }
};
TESSERA_CODEC(FeatureFrame, features_t);

template <>
struct Layout<shared_keypoint_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& shared) {
    fields.Count(message.keypoint, shared.keypoint);
    fields(message.other, shared.other);
    fields.Count(message.other_keypoint, shared.other_keypoint);
    fields(message.position_in_other, shared.position_in_other);
    fields.Check(shared.other.valid(), "a shared keypoint's keyframe has a negative number");
  }
};

template <>
struct Layout<motion_prior_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& prior) {
    fields(message.position_in_reference, prior.position_in_reference);
    fields(message.information, prior.information);
  }
};

template <>
struct Layout<scale_mending_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& mending) {
    fields(message.keyframe, mending.keyframe);
    fields(message.log_factor, mending.log_factor);
    fields.Check(mending.keyframe.valid(), "the scale is to be mended from a keyframe with a negative number");
  }
};

template <>
struct Layout<keyframe_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& keyframe) {
    fields.Key(message.keyframe, keyframe.id);
    fields(message.world_from_camera, keyframe.world_from_camera);
    fields(message.reference, keyframe.reference);
    fields(message.reference_from_camera, keyframe.reference_from_camera);
    fields(message.expected, keyframe.expected);
    fields.Count(message.num_deltas, keyframe.num_deltas);
    fields.Check(keyframe.id.valid(), "its number is negative");
    fields.Check(keyframe.reference < keyframe.id, "its reference is not older");
    DescribeKeypoints(fields, message.keypoints, keyframe.features,
                      CountedColumn(message.num_landmarks, message.landmarks, keyframe.landmarks));
    fields.List(message.num_shared, message.shared, keyframe.shared);
    const auto num_keypoints = static_cast<size_t>(message.keypoints.num_total);
    const bool do_fit = std::all_of(keyframe.shared.begin(), keyframe.shared.end(), [&](const SharedKeypoint& shared) {
      return static_cast<size_t>(shared.keypoint) < num_keypoints && shared.other < keyframe.id;
    });
    fields.Check(do_fit && keyframe.shared.size() <= num_keypoints, "a shared keypoint is out of range");
    fields.List(message.num_mendings, message.mendings, keyframe.mendings);
    const auto are_in_order = std::ranges::is_sorted(keyframe.mendings, std::less_equal{}, &ScaleMending::keyframe);
    fields.Check(are_in_order && (keyframe.mendings.empty() || keyframe.mendings.back().keyframe < keyframe.id),
                 "the keyframes from which the scale is to be mended are not in order");
    fields.List(message.num_not_scene, message.not_scene, keyframe.not_scene);
    fields.Check(std::ranges::is_sorted(keyframe.not_scene, std::less_equal{}),
                 "the landmarks that are none of the scene are not in order");
  }
};
TESSERA_CODEC(KeyframeObservation, keyframe_t);

template <>
struct Layout<pose_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& pose) {
    fields(message.frame, pose.frame);
    fields.Time(message.utime, pose.utime_us);
    fields.Time(message.captured, pose.captured_us);
    fields.Time(message.latency, pose.latency_us);
    fields(message.state, pose.state);
    fields(message.world_from_camera, pose.world_from_camera);
    fields(message.reference_keyframe, pose.reference_keyframe);
    fields(message.reference_from_camera, pose.reference_from_camera);
    fields(message.map_part, pose.map_part);
    fields.Count(message.num_features, pose.num_features);
    fields.Count(message.num_matches, pose.num_matches);
    fields.Count(message.num_inliers, pose.num_inliers);
    fields.Count(message.num_landmarks, pose.num_landmarks);
    fields(message.is_keyframe, pose.is_keyframe);
    fields(message.is_relocalized, pose.is_relocalized);
    fields(message.is_step_doubtful, pose.is_step_doubtful);
    fields(message.scale_sigma, pose.scale_sigma);
    fields(message.relocalized_by, pose.relocalized_by);
    fields.Count(message.num_deltas, pose.num_deltas);
    fields(message.is_live, pose.is_live);
    fields.Count(message.map_wait_us, pose.map_wait_us);
    fields(message.world_from_base, pose.body.world_from_base);
    fields(message.has_covariance, pose.body.has_covariance);
    fields(message.covariance, pose.body.covariance);
    fields(message.has_velocity, pose.body.has_motion);
    fields(message.linear_velocity, pose.body.motion.velocity);
    fields(message.angular_velocity, pose.body.motion.turn_rate);
    fields(message.coverage, pose.coverage);
    fields.Time(message.since_tracked, pose.since_tracked_us);
    fields.Check(pose.frame.valid(), "its frame number is negative");
    fields.Check(pose.relocalized_by <= pose.frame, "the frame that it was relocalized by is newer");
    fields.Check(pose.scale_sigma >= 0.0, "the deviation of its scale is negative");
  }
};
TESSERA_CODEC(PoseEstimate, pose_t);

}  // namespace tessera
