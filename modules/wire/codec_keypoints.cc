#include "wire/codec_keypoints.h"

#include <cmath>

#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr int32_t kMaxKeypoints = 1 << 20;

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

}  // namespace

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

std::string JoinKeypoints(const keypoints_t& message, bool begins, FeatureFrame* frame) {
  if (begins) {
    if (std::string problem = BeginFrame(message, frame); !problem.empty()) return problem;
  }
  const size_t num_had = frame->keypoints.size();
  const auto num_now = static_cast<int64_t>(num_had) + message.num_keypoints;
  if (message.frame != frame->frame.value || message.first != static_cast<int64_t>(num_had) ||
      message.num_total > kMaxKeypoints || num_now > message.num_total) {
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

}  // namespace tessera
