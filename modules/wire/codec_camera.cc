// CAMERA, COLOR, CALIBRATION, GROUND_TRUTH, END_OF_STREAM.
#include <algorithm>
#include <iterator>
#include <string_view>

#include "geometry/camera_frame.h"
#include "messages/end_of_stream.h"
#include "tessera/calibration_t.hpp"
#include "tessera/camera_image_t.hpp"
#include "tessera/color_image_t.hpp"
#include "tessera/end_of_stream_t.hpp"
#include "tessera/ground_truth_t.hpp"
#include "wire/codec_impl.h"

namespace tessera {
namespace {

constexpr int kMaxImageSize = 16384;  // px, as in CameraCalibration::Check

// end_of_stream_t::stage, in the order of StageKind.
constexpr std::string_view kStageNames[] = {"camera", "dispatcher", "reassembler", "tracker", "mapper"};

}  // namespace

void WriteField(StageKind stage, std::string& field) { field = kStageNames[static_cast<size_t>(stage)]; }
Result<> ReadField(const std::string& field, StageKind& stage) {
  const auto* const name = std::find(std::begin(kStageNames), std::end(kStageNames), field);
  if (name == std::end(kStageNames)) return Failed("its stage is none of those that end their streams");
  stage = static_cast<StageKind>(name - std::begin(kStageNames));
  return {};
}

template <>
struct Layout<camera_image_t> {
  static int64_t SourceTime(const CameraFrame& frame) { return frame.utime_us; }

  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& frame) {
    fields.Key(message.frame, frame.id);
    fields.Time(message.utime, frame.utime_us);
    fields.Time(message.age, frame.age_us);
    fields.Time(message.depth_delay, frame.depth_delay_us);
    fields.Key(message.sensor, frame.sensor);
    fields.Key(message.width, frame.left.width);
    fields.Key(message.height, frame.left.height);
    fields.Check(frame.id.valid(), "its frame number is negative");
    fields.Check(IsInside({0, 0, frame.left.width, frame.left.height}, kMaxImageSize, kMaxImageSize),
                 "its image size is not between 1 and 16384 px");
    const auto image = [&](int8_t name, auto& pixels, bool is_there) {
      return ImageField{name, pixels, is_there ? frame.left.width : 0, is_there ? frame.left.height : 0};
    };
    fields.Bands(message.band, image(image_band_t::LEFT, frame.left, true),
                 image(image_band_t::RIGHT, frame.right, frame.sensor == SensorType::kStereo),
                 image(image_band_t::DEPTH, frame.depth, frame.sensor == SensorType::kRgbd));
  }
};
TESSERA_CODEC(CameraFrame, camera_image_t);

template <>
struct Layout<color_image_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& frame) {
    auto& image = frame.image;
    fields.Key(message.frame, frame.id);
    fields.Time(message.utime, frame.utime_us);
    fields.Key(message.width, image.width);
    fields.Key(message.height, image.height);
    fields.Check(frame.id.valid(), "its frame number is negative");
    fields.Check((image.width == 0 && image.height == 0) ||
                     IsInside({0, 0, image.width, image.height}, kMaxImageSize, kMaxImageSize),
                 "its image size is neither 0 nor between 1 and 16384 px");
    fields.Bands(message.band, ImageField{image_band_t::LEFT, image, image.width, image.height});
  }
};
TESSERA_CODEC(ColorFrame, color_image_t);

template <>
struct Layout<calibration_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& calibration) {
    fields(message.camera, calibration);
  }
};
TESSERA_CODEC(CameraCalibration, calibration_t);

template <>
struct Layout<ground_truth_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& pose) {
    fields(message.frame, pose.frame);
    fields.Time(message.utime, pose.utime_us);
    fields(message.world_from_camera, pose.world_from_camera);
    fields.Check(pose.frame.valid(), "its frame number is negative");
  }
};
TESSERA_CODEC(GroundTruthPose, ground_truth_t);

template <>
struct Layout<end_of_stream_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& end) {
    fields(message.stage, end.stage);
    fields.Count(message.num_frames, end.num_frames);
    fields.Count(message.num_dropped, end.num_dropped);
    fields.Count(message.num_values, end.num_values);
  }
};
TESSERA_CODEC(EndOfStream, end_of_stream_t);

}  // namespace tessera
