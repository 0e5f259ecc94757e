#include <algorithm>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "datasets/image_file.h"
#include "datasets/recording.h"
#include "datasets/rectifier.h"

namespace tessera {
namespace {

class RecordedSource : public FrameSource {
 public:
  RecordedSource(Recording recording, const SourceOptions& options);

  const CameraCalibration& calibration() const override { return rectifier_->calibration(); }
  std::optional<int64_t> num_frames() const override { return end_ - first_; }
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  std::optional<CameraFrame> Next() override;
  ColorReader TakeColor() override { return std::exchange(color_, nullptr); }
  void SkipTo(FrameId frame) override { next_ = std::clamp(frame.value, next_, end_); }
  bool is_live() const override { return false; }
  const std::vector<std::string>& notes() const override { return recording_.notes; }

 private:
  void ChooseFrames(const SourceOptions& options);
  void CheckTimes() const;
  void PrepareRectifier(const SourceOptions& options);
  void RectifyGroundTruth();
  template <class Pixel>
  void RequireOwnSize(const Image<Pixel>& image, const std::string& what) const {
    RequireSize(image.width, image.height, calibration().width_px, calibration().height_px, what);
  }
  GrayImage ReadLeft(int64_t index);
  ColorReader ColorOfLeft(int64_t index);
  GrayImage ReadRight(int64_t index);
  DepthImage ReadDepth(int64_t index);

  Recording recording_;
  SensorType sensor_;
  bool with_color_;
  int64_t first_ = 0;
  int64_t end_ = 0;
  int64_t next_ = 0;
  GrayImage first_left_;  // was read to learn its size
  ColorReader color_;     // of the last frame
  std::unique_ptr<Rectifier> rectifier_;
  std::vector<GroundTruthPose> ground_truth_;
};

RecordedSource::RecordedSource(Recording recording, const SourceOptions& options)
    : recording_(std::move(recording)), sensor_(options.sensor), with_color_(options.with_color) {
  ChooseFrames(options);
  CheckTimes();
  PrepareRectifier(options);
  RectifyGroundTruth();
}

void RecordedSource::ChooseFrames(const SourceOptions& options) {
  const auto num_frames = static_cast<int64_t>(recording_.utimes_us.size());
  first_ = options.first_frame;
  end_ = options.last_frame < 0 ? num_frames : options.last_frame;
  next_ = first_;
  if (first_ < 0 || first_ >= end_ || end_ > num_frames) {
    throw InputError("frames " + std::to_string(first_) + ":" + std::to_string(end_) + " are not in " + options.source +
                     ", which has frames 0:" + std::to_string(num_frames) + ": choose a range within");
  }
}

void RecordedSource::CheckTimes() const {
  const std::vector<int64_t>& utimes = recording_.utimes_us;
  for (size_t i = 1; i < utimes.size(); ++i) {
    if (utimes[i] <= utimes[i - 1]) {
      throw InputError("file " + recording_.times_path + ": the time of frame " + std::to_string(i) + " (" +
                       std::to_string(utimes[i]) + " us) is not after that of frame " + std::to_string(i - 1) + " (" +
                       std::to_string(utimes[i - 1]) + " us): repair the file");
    }
  }
}

void RecordedSource::PrepareRectifier(const SourceOptions& options) {
  CameraRig& rig = recording_.rig;
  if (options.depth_unit_m > 0.0) {
    rig.depth_unit_m = options.depth_unit_m;
  }
  first_left_ = recording_.left->Read(first_);
  for (PinholeCamera* camera : {&rig.left, rig.right ? &*rig.right : nullptr}) {
    if (camera != nullptr && camera->width_px == 0) {
      camera->width_px = first_left_.width;
      camera->height_px = first_left_.height;
    }
  }
  ThrowIfFailed<InputError>(rig.Check(sensor_), "the calibration of " + options.source +
                                                    " is not usable with --sensor " + ToString(sensor_) + ": ");
  RequireSize(first_left_.width, first_left_.height, rig.left.width_px, rig.left.height_px,
              "image " + recording_.left->Name(first_));
  rectifier_ = std::make_unique<Rectifier>(rig, sensor_);
  ThrowIfFailed<InputError>(calibration().Check(), "the calibration of " + options.source + " can't be used: ");
}

// world_from_rectified = world_from_left * left_from_rectified
void RecordedSource::RectifyGroundTruth() {
  for (GroundTruthPose pose : recording_.ground_truth) {
    if (pose.frame.value < first_ || pose.frame.value >= end_) {
      continue;
    }
    if (!rectifier_->is_identity()) {
      pose.world_from_camera = pose.world_from_camera * rectifier_->left_from_rectified();
    }
    ground_truth_.push_back(pose);
  }
}

GrayImage RecordedSource::ReadLeft(int64_t index) {
  GrayImage image = index == first_ ? std::move(first_left_) : recording_.left->Read(index);
  RequireOwnSize(image, "image " + recording_.left->Name(index));
  return rectifier_->Left(std::move(image));
}

// Of the left image that was read last, which has the number `index`.
ColorReader RecordedSource::ColorOfLeft(int64_t index) {
  ColorReader read = with_color_ ? recording_.left->ColorOfLast() : nullptr;
  if (!read) return nullptr;
  return [this, index, read = std::move(read)]() -> ColorImage {
    ColorImage image = read();
    if (image.empty()) return image;
    RequireOwnSize(image, "image " + recording_.left->Name(index));
    return rectifier_->LeftColor(std::move(image));
  };
}

GrayImage RecordedSource::ReadRight(int64_t index) {
  GrayImage image = recording_.right->Read(index);
  RequireOwnSize(image, "image " + recording_.right->Name(index));
  return rectifier_->Right(std::move(image));
}

DepthImage RecordedSource::ReadDepth(int64_t index) {
  const std::string& path = recording_.depth_paths.at(static_cast<size_t>(index));
  if (path.empty()) return DepthImage(calibration().width_px, calibration().height_px);
  DepthImage image = ReadDepthImage(path);
  RequireOwnSize(image, "depth image " + path);
  return rectifier_->Depth(std::move(image));
}

std::optional<CameraFrame> RecordedSource::Next() {
  if (next_ >= end_) {
    return std::nullopt;
  }
  CameraFrame frame;
  frame.id = FrameId{next_};
  frame.utime_us = recording_.utimes_us[static_cast<size_t>(next_)];
  frame.sensor = sensor_;
  frame.left = ReadLeft(next_);
  color_ = ColorOfLeft(next_);
  if (sensor_ == SensorType::kStereo) {
    frame.right = ReadRight(next_);
  }
  if (sensor_ == SensorType::kRgbd) {
    frame.depth = ReadDepth(next_);
    frame.depth_delay_us = recording_.depth_delays_us.at(static_cast<size_t>(next_));
  }
  ++next_;
  return frame;
}

}  // namespace

std::unique_ptr<FrameSource> PlayRecording(Recording recording, const SourceOptions& options) {
  return std::make_unique<RecordedSource>(std::move(recording), options);
}

}  // namespace tessera
