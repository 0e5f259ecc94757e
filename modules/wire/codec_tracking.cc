// FEATURES, POSE, KEYFRAME.
#include <algorithm>

#include "messages/tracking_types.h"
#include "tessera/features_t.hpp"
#include "tessera/keyframe_t.hpp"
#include "tessera/pose_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_keypoints.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr const char* kIncomplete = "its parts do not fit together";

}  // namespace

template <>
struct Codec<FeatureFrame> {
  using Message = features_t;
  static constexpr const char* kTypeName = "features_t";

  template <class Emit>
  static void Cut(const FeatureFrame& frame, Message* message, size_t max_bytes, Emit emit) {
    SetFrame(frame, &message->keypoints);
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    const size_t per_part = std::max<size_t>(1, (max_bytes - overhead) / kBytesPerKeypoint);
    size_t first = 0;
    do {
      const size_t num = std::min(per_part, frame.keypoints.size() - first);
      FillKeypoints(frame, first, num, &message->keypoints);
      emit(*message);
      first += num;
    } while (first < frame.keypoints.size());
  }
  static std::string Join(const Message& message, FeatureFrame* frame) {
    const bool is_last = message.header.part + 1 == message.header.num_parts;
    const std::string problem = JoinKeypoints(message.keypoints, message.header.part == 0, frame);
    return FirstProblem({problem, SentenceUnless(!is_last || HasAllKeypoints(message.keypoints, *frame), kIncomplete)});
  }
};
TESSERA_CODEC(FeatureFrame);

template <>
struct Codec<KeyframeObservation> {
  using Message = keyframe_t;
  static constexpr const char* kTypeName = "keyframe_t";
  static constexpr size_t kBytesEach = kBytesPerKeypoint + 8;  // a keypoint and its landmark
  static constexpr size_t kBytesPerShared = 4 + 8 + 4 + 3 * 8;

  template <class Emit>
  static void Cut(const KeyframeObservation& keyframe, Message* message, size_t max_bytes, Emit emit) {
    message->keyframe = keyframe.id.value;
    message->world_from_camera = ToMessage(keyframe.world_from_camera);
    message->reference = keyframe.reference.value;
    message->reference_from_camera = ToMessage(keyframe.reference_from_camera);
    message->num_deltas = keyframe.num_deltas;
    SetFrame(keyframe.features, &message->keypoints);
    const size_t room = max_bytes - static_cast<size_t>(message->getEncodedSize());
    const size_t num_keypoints = keyframe.features.keypoints.size();
    size_t first = 0, first_shared = 0;
    do {
      const size_t num = std::min(std::max<size_t>(1, room / kBytesEach), num_keypoints - first);
      FillKeypoints(keyframe.features, first, num, &message->keypoints);
      message->num_landmarks = static_cast<int32_t>(num);
      message->landmarks.resize(num);
      for (size_t i = 0; i < num; ++i) message->landmarks[i] = keyframe.landmarks[first + i].value;
      first += num;
      // What follows the last keypoints fills their message up.
      const size_t left = first == num_keypoints ? room - std::min(room, num * kBytesEach) : 0;
      const size_t at_least = num == 0 ? 1 : 0;
      const size_t num_shared =
          std::min(std::max(at_least, left / kBytesPerShared), keyframe.shared.size() - first_shared);
      FillShared(keyframe, first_shared, num_shared, message);
      first_shared += num_shared;
      emit(*message);
    } while (first < num_keypoints || first_shared < keyframe.shared.size());
  }

  static std::string Join(const Message& message, KeyframeObservation* keyframe) {
    const bool begins = message.header.part == 0, is_last = message.header.part + 1 == message.header.num_parts;
    if (begins) {
      *keyframe = {};
      keyframe->id.value = message.keyframe;
      keyframe->reference.value = message.reference;
      keyframe->num_deltas = message.num_deltas;
    }
    const std::string problem = FirstProblem(
        {SentenceUnless(message.keyframe >= 0 && message.keyframe == keyframe->id.value, "its number is out of range"),
         SentenceUnless(message.reference >= -1 && message.reference < message.keyframe && message.num_deltas >= 0,
                        "its reference or its count of deltas is out of range"),
         FromMessage(message.world_from_camera, &keyframe->world_from_camera),
         FromMessage(message.reference_from_camera, &keyframe->reference_from_camera),
         SentenceUnless(message.num_landmarks == message.keypoints.num_keypoints,
                        "it has not one landmark for each keypoint"),
         JoinKeypoints(message.keypoints, begins, &keyframe->features),
         SentenceUnless(!is_last || HasAllKeypoints(message.keypoints, keyframe->features), kIncomplete)});
    if (!problem.empty()) return problem;
    for (size_t i = 0; i < static_cast<size_t>(message.num_landmarks); ++i) {
      if (message.landmarks[i] < -1) return "a landmark's number is out of range";
      keyframe->landmarks.push_back({message.landmarks[i]});
    }
    return JoinShared(message, keyframe);
  }

 private:
  static void FillShared(const KeyframeObservation& keyframe, size_t first, size_t num, Message* message) {
    message->num_shared = static_cast<int32_t>(num);
    message->shared.resize(num);
    for (size_t i = 0; i < num; ++i) {
      const SharedKeypoint& shared = keyframe.shared[first + i];
      message->shared[i].keypoint = shared.keypoint;
      message->shared[i].other = shared.other.value;
      message->shared[i].other_keypoint = shared.other_keypoint;
      ToMessage(shared.position_in_other, message->shared[i].position_in_other);
    }
  }
  static std::string JoinShared(const Message& message, KeyframeObservation* keyframe) {
    const auto num_total = static_cast<size_t>(message.keypoints.num_total);
    for (size_t i = 0; i < static_cast<size_t>(message.num_shared); ++i) {
      const shared_keypoint_t& shared = message.shared[i];
      SharedKeypoint& joined = keyframe->shared.emplace_back(
          SharedKeypoint{shared.keypoint, {shared.other}, shared.other_keypoint, Eigen::Vector3d::Zero()});
      const bool is_in_range = shared.keypoint >= 0 && static_cast<size_t>(shared.keypoint) < num_total &&
                               shared.other >= 0 && shared.other < message.keyframe && shared.other_keypoint >= 0 &&
                               keyframe->shared.size() <= num_total;
      if (!is_in_range || !FromMessage(shared.position_in_other, &joined.position_in_other)) {
        return "a shared keypoint is out of range";
      }
    }
    return "";
  }
};
TESSERA_CODEC(KeyframeObservation);

template <>
struct Codec<PoseEstimate> {
  using Message = pose_t;
  static constexpr const char* kTypeName = "pose_t";

  template <class Emit>
  static void Cut(const PoseEstimate& pose, Message* message, size_t, Emit emit) {
    message->frame = pose.frame.value;
    message->utime = pose.utime_us;
    message->arrival = pose.arrival_us;
    message->state = static_cast<int8_t>(pose.state);
    message->world_from_camera = ToMessage(pose.world_from_camera);
    message->reference_keyframe = pose.reference_keyframe.value;
    message->reference_from_camera = ToMessage(pose.reference_from_camera);
    message->num_features = pose.num_features;
    message->num_matches = pose.num_matches;
    message->num_inliers = pose.num_inliers;
    message->num_landmarks = pose.num_landmarks;
    message->is_keyframe = pose.is_keyframe ? 1 : 0;
    message->num_deltas = pose.num_deltas;
    message->is_live = pose.is_live ? 1 : 0;
    message->is_relocalized = pose.is_relocalized ? 1 : 0;
    message->relocalized_by = pose.relocalized_by.value;
    message->map_wait_us = pose.map_wait_us;
    emit(*message);
  }

  static std::string Join(const Message& message, PoseEstimate* pose) {
    *pose = {.frame = {message.frame},
             .utime_us = message.utime,
             .arrival_us = message.arrival,
             .state = static_cast<TrackingState>(message.state),
             .world_from_camera = {},
             .reference_keyframe = {message.reference_keyframe},
             .reference_from_camera = {},
             .num_features = message.num_features,
             .num_matches = message.num_matches,
             .num_inliers = message.num_inliers,
             .num_landmarks = message.num_landmarks,
             .is_keyframe = message.is_keyframe != 0,
             .is_relocalized = message.is_relocalized != 0,
             .relocalized_by = {message.relocalized_by},
             .num_deltas = message.num_deltas,
             .is_live = message.is_live != 0,
             .map_wait_us = message.map_wait_us};
    return FirstProblem(
        {CheckFrame(message.frame), CheckTimes(message.utime, message.arrival),
         SentenceUnless(message.state >= pose_t::INITIALIZING && message.state <= pose_t::LOST, "its state is none"),
         FromMessage(message.world_from_camera, &pose->world_from_camera),
         FromMessage(message.reference_from_camera, &pose->reference_from_camera),
         SentenceUnless(message.reference_keyframe >= -1 && message.num_features >= 0 && message.num_matches >= 0 &&
                            message.num_inliers >= 0 && message.num_landmarks >= 0 && message.num_deltas >= 0 &&
                            message.relocalized_by >= -1 && message.relocalized_by <= message.frame &&
                            message.map_wait_us >= 0,
                        "one of its counts is negative")});
  }
};
TESSERA_CODEC(PoseEstimate);

}  // namespace tessera
