// CAMERA, CALIBRATION, GROUND_TRUTH, END_OF_STREAM.
#include <algorithm>
#include <iterator>
#include <string_view>

#include "geometry/camera_frame.h"
#include "messages/end_of_stream.h"
#include "tessera/calibration_t.hpp"
#include "tessera/camera_image_t.hpp"
#include "tessera/end_of_stream_t.hpp"
#include "tessera/ground_truth_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr int kMaxImageSize = 16384;  // px, as in CameraCalibration::Check

// end_of_stream_t::stage, in the order of StageKind.
constexpr std::string_view kStageNames[] = {"camera", "dispatcher", "reassembler", "tracker", "mapper"};

}  // namespace

template <>
struct Codec<CameraFrame> {
  using Message = camera_image_t;
  static constexpr const char* kTypeName = "camera_image_t";

  static int64_t SourceTime(const CameraFrame& frame) { return frame.utime_us; }

  template <class Emit>
  static void Cut(const CameraFrame& frame, Message* message, size_t max_bytes, Emit emit) {
    message->frame = frame.id.value;
    message->utime = frame.utime_us;
    message->sensor = static_cast<int8_t>(frame.sensor);
    message->width = frame.left.width;
    message->height = frame.left.height;
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    CutBands({Banded(image_band_t::LEFT, frame.left), Banded(image_band_t::RIGHT, frame.right),
              Banded(image_band_t::DEPTH, frame.depth)},
             max_bytes - overhead, &message->band, [&] { emit(*message); });
  }

  static std::string Join(const Message& message, CameraFrame* frame) {
    if (message.header.part == 0) {
      if (const std::string problem = Begin(message, frame); !problem.empty()) return problem;
    }
    if (message.frame != frame->id.value || message.utime != frame->utime_us ||
        message.sensor != static_cast<int8_t>(frame->sensor)) {
      return "its parts belong to different frames";
    }
    if (std::string problem = AddBand(message, frame); !problem.empty()) return problem;
    const bool is_last = message.header.part + 1 == message.header.num_parts;
    return SentenceUnless(!is_last || Misses(*frame, message.width, message.height) < 0, "not all of its pixels came");
  }

 private:
  static std::string Begin(const Message& message, CameraFrame* frame) {
    *frame = {};
    frame->id.value = message.frame;
    frame->utime_us = message.utime;
    frame->sensor = static_cast<SensorType>(message.sensor);
    return FirstProblem(
        {CheckFrame(message.frame), CheckTimes(message.utime, 0),
         SentenceUnless(message.sensor >= camera_model_t::MONO && message.sensor <= camera_model_t::RGBD,
                        "its sensor is none of mono, stereo, rgbd"),
         SentenceUnless(message.width >= 1 && message.width <= kMaxImageSize && message.height >= 1 &&
                            message.height <= kMaxImageSize,
                        "its image size is not between 1 and 16384 px")});
  }
  // The image that the next pixels belong to; -1 if the frame is complete.
  static int Misses(const CameraFrame& frame, int width, int height) {
    if (!IsComplete(frame.left, width, height)) return image_band_t::LEFT;
    if (frame.sensor == SensorType::kStereo && !IsComplete(frame.right, width, height)) return image_band_t::RIGHT;
    if (frame.sensor == SensorType::kRgbd && !IsComplete(frame.depth, width, height)) return image_band_t::DEPTH;
    return -1;
  }
  static std::string AddBand(const Message& message, CameraFrame* frame) {
    const int width = message.width;
    const int height = message.height;
    if (message.header.part > 0 && (width != frame->left.width || height != frame->left.height)) {
      return "its parts differ in image size";
    }
    if (message.band.image != Misses(*frame, width, height)) {
      return "its parts are not in order";
    }
    switch (message.band.image) {
      case image_band_t::LEFT:
        return JoinBand(message.band, width, height, &frame->left);
      case image_band_t::RIGHT:
        return JoinBand(message.band, width, height, &frame->right);
      default:
        return JoinBand(message.band, width, height, &frame->depth);
    }
  }
};
TESSERA_CODEC(CameraFrame);

template <>
struct Codec<CameraCalibration> {
  using Message = calibration_t;
  static constexpr const char* kTypeName = "calibration_t";

  template <class Emit>
  static void Cut(const CameraCalibration& calibration, Message* message, size_t, Emit emit) {
    message->camera = ToMessage(calibration);
    emit(*message);
  }
  static std::string Join(const Message& message, CameraCalibration* calibration) {
    return FromMessage(message.camera, calibration);
  }
};
TESSERA_CODEC(CameraCalibration);

template <>
struct Codec<GroundTruthPose> {
  using Message = ground_truth_t;
  static constexpr const char* kTypeName = "ground_truth_t";

  template <class Emit>
  static void Cut(const GroundTruthPose& pose, Message* message, size_t, Emit emit) {
    message->frame = pose.frame.value;
    message->utime = pose.utime_us;
    message->world_from_camera = ToMessage(pose.world_from_camera);
    emit(*message);
  }
  static std::string Join(const Message& message, GroundTruthPose* pose) {
    pose->frame.value = message.frame;
    pose->utime_us = message.utime;
    return FirstProblem({CheckFrame(message.frame), CheckTimes(message.utime, 0),
                         FromMessage(message.world_from_camera, &pose->world_from_camera)});
  }
};
TESSERA_CODEC(GroundTruthPose);

template <>
struct Codec<EndOfStream> {
  using Message = end_of_stream_t;
  static constexpr const char* kTypeName = "end_of_stream_t";

  template <class Emit>
  static void Cut(const EndOfStream& end, Message* message, size_t, Emit emit) {
    message->stage = kStageNames[static_cast<size_t>(end.stage)];
    message->num_frames = end.num_frames;
    message->num_dropped = end.num_dropped;
    message->num_values = end.num_values;
    emit(*message);
  }
  static std::string Join(const Message& message, EndOfStream* end) {
    const auto* const name = std::find(std::begin(kStageNames), std::end(kStageNames), message.stage);
    if (name == std::end(kStageNames)) return "its stage is none of those that end their streams";
    *end = {.stage = static_cast<StageKind>(name - std::begin(kStageNames)),
            .num_frames = message.num_frames,
            .num_dropped = message.num_dropped,
            .num_values = message.num_values};
    return FirstProblem(
        {CheckFrame(message.num_frames),
         SentenceUnless(end->num_dropped >= 0 && end->num_dropped <= end->num_frames && end->num_values >= 0,
                        "its counts are out of range")});
  }
};
TESSERA_CODEC(EndOfStream);

}  // namespace tessera
