#include "datasets/stream_source.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <utility>

#include "core/errors.h"
#include "datasets/calibration_file.h"
#include "datasets/image_file.h"
#include "datasets/rectifier.h"
#include "datasets/video_input.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr double kAssumedFramesPerS = 30.0;  // where the stream doesn't say

class StreamSource : public FrameSource {
 public:
  StreamSource(VideoInput video, CameraRig rig, const SourceOptions& options, bool is_live);

  const CameraCalibration& calibration() const override { return rectifier_->calibration(); }
  std::optional<int64_t> num_frames() const override;
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  std::optional<CameraFrame> Next() override;
  ColorReader TakeColor() override { return std::exchange(color_, nullptr); }
  bool is_live() const override { return is_live_; }
  const std::vector<std::string>& notes() const override { return notes_; }

 private:
  void ChooseFrames(const SourceOptions& options);
  void NoteEarlyEnd();
  int64_t TimeOfLastImage();
  ColorReader ColorOfLast() const;

  std::string name_;
  VideoInput video_;
  bool is_live_;
  bool with_color_;
  double frames_per_s_;
  int64_t first_ = 0;
  int64_t end_ = -1;  // -1: until the stream ends
  int64_t next_ = 0;
  int64_t last_utime_us_ = -1;
  std::optional<GrayImage> first_image_;       // was read to learn its size
  ColorReader color_;                          // of the last frame
  std::shared_ptr<Rectifier> rectifier_;       // color_ has it too
  std::vector<GroundTruthPose> ground_truth_;  // none
  std::vector<std::string> notes_;
};

StreamSource::StreamSource(VideoInput video, CameraRig rig, const SourceOptions& options, bool is_live)
    : name_(options.source),
      video_(std::move(video)),
      is_live_(is_live),
      with_color_(options.with_color),
      frames_per_s_(video_.frames_per_s()) {
  if (frames_per_s_ == 0.0 && !is_live_) {
    frames_per_s_ = kAssumedFramesPerS;
    notes_.push_back("Warning: " + name_ +
                     " does not tell its frame rate; where its images have no times, 30 a second are assumed.");
  }
  ChooseFrames(options);
  first_image_ = video_.Read();
  if (!first_image_) {
    throw InputError(name_ + " yields no image: it is damaged or empty");
  }
  if (rig.left.width_px == 0) {
    rig.left.width_px = first_image_->width;
    rig.left.height_px = first_image_->height;
  }
  RequireSize(first_image_->width, first_image_->height, rig.left.width_px, rig.left.height_px,
              "the first image of " + name_);
  rectifier_ = std::make_shared<Rectifier>(rig, SensorType::kMono);
}

void StreamSource::ChooseFrames(const SourceOptions& options) {
  const int64_t num_images = is_live_ ? 0 : video_.num_images();
  first_ = options.first_frame;
  end_ = options.last_frame < 0 && num_images > 0 ? num_images : options.last_frame;
  const bool is_empty = end_ >= 0 && first_ >= end_;
  if (first_ < 0 || is_empty || (num_images > 0 && end_ > num_images)) {
    throw InputError("frames " + std::to_string(first_) + ":" + std::to_string(end_) + " are not in " + name_ +
                     (num_images > 0 ? ", which has frames 0:" + std::to_string(num_images) : "") +
                     ": choose a range within");
  }
  for (; next_ < first_; ++next_) {
    if (!video_.Skip()) {
      throw InputError(name_ + " ends at frame " + std::to_string(next_) + ", before frame " + std::to_string(first_) +
                       ": choose an earlier range");
    }
  }
}

void StreamSource::NoteEarlyEnd() {
  if (is_live_ || end_ < 0) return;
  notes_.push_back(name_ + " is cut off: it ends after " + std::to_string(next_ - first_) + " of the " +
                   std::to_string(end_ - first_) + " frames that it announces");
  end_ = next_;
}

std::optional<int64_t> StreamSource::num_frames() const {
  return end_ < 0 ? std::nullopt : std::optional(end_ - first_);
}

// A file's images have times of their own, also where their rate varies (phones); where they don't, they are evenly
// spaced.
int64_t StreamSource::TimeOfLastImage() {
  const int64_t stamp_us = std::llround(video_.position_ms() * 1e3);
  if (is_live_) return stamp_us;
  const bool goes_on = stamp_us > last_utime_us_ || (stamp_us == 0 && last_utime_us_ < 0);
  last_utime_us_ = goes_on ? stamp_us : last_utime_us_ + std::llround(1e6 / frames_per_s_);
  return last_utime_us_;
}

std::optional<CameraFrame> StreamSource::Next() {
  if (end_ >= 0 && next_ >= end_) {
    return std::nullopt;
  }
  std::optional<GrayImage> image = std::move(first_image_);
  first_image_.reset();
  if (!image) {
    image = video_.Read();
  }
  if (!image) {
    NoteEarlyEnd();
    return std::nullopt;
  }
  RequireSize(image->width, image->height, calibration().width_px, calibration().height_px,
              "frame " + std::to_string(next_) + " of " + name_);
  CameraFrame frame;
  frame.id = FrameId{next_};
  frame.utime_us = TimeOfLastImage();
  frame.left = rectifier_->Left(std::move(*image));
  color_ = ColorOfLast();
  ++next_;
  return frame;
}

// Also after this source is gone.
ColorReader StreamSource::ColorOfLast() const {
  ColorReader read = with_color_ ? video_.ColorOfLast() : nullptr;
  if (!read) return nullptr;
  return [rectifier = rectifier_, read = std::move(read)]() -> ColorImage {
    ColorImage image = read();
    return image.empty() ? image : rectifier->LeftColor(std::move(image));
  };
}

void RequireMono(const SourceOptions& options) {
  if (options.sensor != SensorType::kMono) {
    throw InputError(options.source + " has one image at a time and can't serve --sensor " + ToString(options.sensor) +
                     ": use --sensor mono");
  }
}

CameraRig RequireCalibration(const SourceOptions& options) {
  if (options.calibration_path.empty()) {
    throw InputError(options.source +
                     " brings no calibration: give --camera FILE.yaml (config/cameras/example.yaml shows how)");
  }
  return LoadCalibrationFile(options.calibration_path);
}

}  // namespace

std::unique_ptr<FrameSource> OpenVideoFile(const std::string& path, const SourceOptions& options) {
  RequireMono(options);
  VideoInput video = VideoInput::OpenFile(path);
  SourceOptions with_calibration = options;
  const fs::path beside = fs::path(path).replace_extension(".yaml");
  if (options.calibration_path.empty() && fs::is_regular_file(beside)) {
    with_calibration.calibration_path = beside;
  } else if (options.calibration_path.empty()) {
    throw InputError(options.source + " brings no calibration: give --camera FILE.yaml or put " + beside.string() +
                     " there (config/cameras/example.yaml shows how)");
  }
  return std::make_unique<StreamSource>(std::move(video), RequireCalibration(with_calibration), with_calibration,
                                        false);
}

std::unique_ptr<FrameSource> OpenDevice(const std::string& index, const SourceOptions& options) {
  RequireMono(options);
  int number = -1;
  const auto [stop, error] = std::from_chars(index.data(), index.data() + index.size(), number);
  if (error != std::errc() || stop != index.data() + index.size() || number < 0) {
    throw InputError("source `" + options.source + "`: write camera:N for the device /dev/videoN");
  }
  CameraRig rig = RequireCalibration(options);
  VideoInput video = VideoInput::OpenDevice(number, rig.left.width_px, rig.left.height_px);
  return std::make_unique<StreamSource>(std::move(video), std::move(rig), options, true);
}

std::unique_ptr<FrameSource> OpenNetworkStream(const std::string& url, const SourceOptions& options) {
  RequireMono(options);
  CameraRig rig = RequireCalibration(options);
  return std::make_unique<StreamSource>(VideoInput::OpenUrl(url), std::move(rig), options, true);
}

}  // namespace tessera
