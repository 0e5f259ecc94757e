// LOOP_RESULT, GLOBAL_ADJUSTMENT, RELOCALIZATION_REQUEST, RELOCALIZATION.
#include "messages/loop_types.h"
#include "tessera/global_adjustment_t.hpp"
#include "tessera/loop_result_t.hpp"
#include "tessera/relocalization_request_t.hpp"
#include "tessera/relocalization_t.hpp"
#include "wire/codec_impl.h"
#include "wire/keypoints_layout.h"

namespace tessera {

template <>
struct Layout<seen_landmark_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& seen) {
    fields.Count(message.keypoint, seen.keypoint);
    fields(message.landmark, seen.landmark);
    fields.Check(seen.landmark.valid(), "a seen landmark's number is negative");
  }
};

template <>
struct Layout<correction_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& correction) {
    fields(message.keyframe, correction.id);
    fields(message.new_world_from_old, correction.new_world_from_old);
    fields.Check(correction.id.valid(), "a corrected keyframe's number is negative");
  }
};

template <>
struct Layout<loop_result_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& result) {
    fields.Key(message.keyframe, result.answers);
    fields(message.matched, result.matched);
    fields(message.matched_from_current, result.matched_from_current);
    fields(message.joins_parts, result.joins_parts);
    fields.Count(message.num_candidates, result.num_candidates);
    fields.Count(message.num_consistent, result.num_consistent);
    fields.Count(message.num_matched, result.num_matched);
    fields.Count(message.num_aligned, result.num_aligned);
    fields.Count(message.num_contradicted, result.num_contradicted);
    fields.Check(result.answers.valid(), "its keyframe's number is negative");
    fields.Check(result.matched < result.answers, "its matched keyframe is not older");
    fields.List(message.num_corrections, message.corrections, result.corrections);
    fields.List(message.num_seen, message.seen, result.seen);
  }
};
TESSERA_CODEC(LoopResult, loop_result_t);

template <>
struct Layout<keyframe_pose_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& pose) {
    fields(message.keyframe, pose.id);
    fields(message.world_from_camera, pose.world_from_camera);
    fields.Check(pose.id.valid(), "a pose's keyframe has a negative number");
  }
};

template <>
struct Layout<landmark_position_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& point) {
    fields(message.landmark, point.id);
    fields(message.position_in_world, point.position_in_world);
    fields.Check(point.id.valid(), "a landmark's number is negative");
  }
};

template <>
struct Layout<global_adjustment_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& adjustment) {
    fields.Key(message.keyframe, adjustment.answers);
    fields.Key(message.delta, adjustment.delta);
    fields(message.is_usable, adjustment.is_usable);
    fields.Check(adjustment.answers.valid() && adjustment.delta >= 0, "its keyframe or delta has a negative number");
    fields.List(message.num_poses, message.poses, adjustment.poses);
    fields.List(message.num_points, message.points, adjustment.points);
  }
};
TESSERA_CODEC(GlobalAdjustment, global_adjustment_t);

template <>
struct Layout<relocalization_request_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& request) {
    fields(message.last_keyframe, request.last_keyframe);
    fields(message.keypoints, request.features);
  }
};
TESSERA_CODEC(RelocalizationRequest, relocalization_request_t);

template <>
struct Layout<relocalization_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& answer) {
    fields.Key(message.frame, answer.frame);
    fields(message.reference, answer.reference);
    fields(message.reference_from_camera, answer.reference_from_camera);
    fields.Count(message.num_candidates, answer.num_candidates);
    fields.Check(answer.frame.valid(), "its frame number is negative");
    fields.List(message.num_seen, message.seen, answer.seen);
  }
};
TESSERA_CODEC(RelocalizationAnswer, relocalization_t);

}  // namespace tessera
