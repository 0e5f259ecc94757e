// FEATURES, POSE, KEYFRAME.
#include <algorithm>
#include <cmath>

#include "tessera/features_t.hpp"
#include "tessera/keyframe_t.hpp"
#include "tessera/pose_t.hpp"
#include "transport/codec_impl.h"
#include "transport/codec_parts.h"

namespace tessera {
namespace {

constexpr int32_t kMaxKeypoints = 1 << 20;
constexpr size_t kBytesPerKeypoint = 4 + 4 + 1 + 1 + 4 + 4 + 4 + 32;

// Everything but the keypoints themselves.
void SetFrame(const FeatureFrame& frame, keypoints_t* message) {
  message->frame = frame.frame.value;
  message->utime = frame.utime_us;
  message->arrival = frame.arrival_us;
  message->camera = ToMessage(frame.calibration);
  message->num_total = static_cast<int32_t>(frame.keypoints.size());
}

void FillKeypoints(const FeatureFrame& frame, size_t first, size_t num, keypoints_t* message) {
  message->first = static_cast<int32_t>(first);
  message->num_keypoints = static_cast<int32_t>(num);
  message->x.resize(num);
  message->y.resize(num);
  message->level.resize(num);
  message->angle.resize(num);
  message->score.resize(num);
  message->right_x.resize(num);
  message->depth_m.resize(num);
  message->descriptors.resize(num);
  for (size_t i = 0; i < num; ++i) {
    const Keypoint& keypoint = frame.keypoints[first + i];
    message->x[i] = keypoint.x_px;
    message->y[i] = keypoint.y_px;
    message->level[i] = keypoint.level;
    message->angle[i] = keypoint.angle;
    message->score[i] = keypoint.score;
    message->right_x[i] = keypoint.right_x_px;
    message->depth_m[i] = keypoint.depth_m;
    message->descriptors[i] = ToMessage(frame.descriptors[first + i]);
  }
}

bool IsInRange(const keypoints_t& message, size_t i) {
  // Keypoints of coarse levels may round to just beyond the last pixel.
  return message.x[i] >= -1.0F && message.x[i] <= static_cast<float>(message.camera.width) && message.y[i] >= -1.0F &&
         message.y[i] <= static_cast<float>(message.camera.height) && message.level[i] < kMaxLevels &&
         message.score[i] >= 0 && message.score[i] <= UINT16_MAX && std::isfinite(message.right_x[i]) &&
         std::isfinite(message.depth_m[i]) && message.depth_m[i] >= 0.0F;
}

std::string BeginFrame(const keypoints_t& message, FeatureFrame* frame) {
  *frame = {};
  frame->frame.value = message.frame;
  frame->utime_us = message.utime;
  frame->arrival_us = message.arrival;
  return FirstProblem({CheckFrame(message.frame), CheckTimes(message.utime, message.arrival),
                       FromMessage(message.camera, &frame->calibration)});
}

std::string JoinKeypoints(const header_t& header, const keypoints_t& message, FeatureFrame* frame) {
  if (header.part == 0) {
    if (std::string problem = BeginFrame(message, frame); !problem.empty()) return problem;
  }
  const size_t num_had = frame->keypoints.size();
  const bool is_last = header.part + 1 == header.num_parts;
  const auto num_now = static_cast<int64_t>(num_had) + message.num_keypoints;
  if (message.frame != frame->frame.value || message.first != static_cast<int64_t>(num_had) ||
      message.num_total > kMaxKeypoints || num_now > message.num_total || (is_last && num_now != message.num_total)) {
    return "its parts do not fit together";
  }
  for (size_t i = 0; i < static_cast<size_t>(message.num_keypoints); ++i) {
    if (!IsInRange(message, i)) {
      return "a keypoint is out of range";
    }
    frame->keypoints.push_back({.x_px = message.x[i],
                                .y_px = message.y[i],
                                .right_x_px = message.right_x[i],
                                .depth_m = message.depth_m[i],
                                .score = static_cast<uint16_t>(message.score[i]),
                                .level = message.level[i],
                                .angle = message.angle[i]});
    frame->descriptors.push_back(FromMessage(message.descriptors[i]));
  }
  return "";
}

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
    return JoinKeypoints(message.header, message.keypoints, frame);
  }
};
TESSERA_CODEC(FeatureFrame);

template <>
struct Codec<KeyframeObservation> {
  using Message = keyframe_t;
  static constexpr const char* kTypeName = "keyframe_t";

  template <class Emit>
  static void Cut(const KeyframeObservation& keyframe, Message* message, size_t max_bytes, Emit emit) {
    message->keyframe = keyframe.id.value;
    message->world_from_camera = ToMessage(keyframe.world_from_camera);
    SetFrame(keyframe.features, &message->keypoints);
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    const size_t per_part = std::max<size_t>(1, (max_bytes - overhead) / (kBytesPerKeypoint + 8));
    size_t first = 0;
    do {
      const size_t num = std::min(per_part, keyframe.features.keypoints.size() - first);
      FillKeypoints(keyframe.features, first, num, &message->keypoints);
      message->num_landmarks = static_cast<int32_t>(num);
      message->landmarks.resize(num);
      for (size_t i = 0; i < num; ++i) {
        message->landmarks[i] = keyframe.landmarks[first + i].value;
      }
      emit(*message);
      first += num;
    } while (first < keyframe.features.keypoints.size());
  }

  static std::string Join(const Message& message, KeyframeObservation* keyframe) {
    if (message.header.part == 0) {
      *keyframe = {};
      keyframe->id.value = message.keyframe;
    }
    const std::string problem = FirstProblem(
        {Require(message.keyframe >= 0 && message.keyframe == keyframe->id.value, "its keyframe number is out of range"),
         FromMessage(message.world_from_camera, &keyframe->world_from_camera),
         Require(message.num_landmarks == message.keypoints.num_keypoints, "it has not one landmark for each keypoint"),
         JoinKeypoints(message.header, message.keypoints, &keyframe->features)});
    if (!problem.empty()) return problem;
    for (size_t i = 0; i < static_cast<size_t>(message.num_landmarks); ++i) {
      if (message.landmarks[i] < -1) return "a landmark's number is out of range";
      keyframe->landmarks.push_back({message.landmarks[i]});
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
             .is_keyframe = message.is_keyframe != 0};
    return FirstProblem(
        {CheckFrame(message.frame), CheckTimes(message.utime, message.arrival),
         Require(message.state >= pose_t::INITIALIZING && message.state <= pose_t::LOST, "its state is none"),
         FromMessage(message.world_from_camera, &pose->world_from_camera),
         FromMessage(message.reference_from_camera, &pose->reference_from_camera),
         Require(message.reference_keyframe >= -1 && message.num_features >= 0 && message.num_matches >= 0 &&
                     message.num_inliers >= 0 && message.num_landmarks >= 0,
                 "one of its counts is negative")});
  }
};
TESSERA_CODEC(PoseEstimate);

}  // namespace tessera
