#include "datasets/doubled_source.h"

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>

#include "datasets/remap_table.h"

namespace tessera {
namespace {

// Pixel x of the doubled image stands at (x + 1/2) / 2 - 1/2 of the original one: a quarter before or behind a pixel.
RemapTable TableOf(const CameraCalibration& original) {
  constexpr int kSteps = RemapTable::kSteps;
  const cv::Size size(2 * original.width_px, 2 * original.height_px);
  cv::Mat whole(size, CV_16SC2), fraction(size, CV_16UC1);
  const auto whole_of = [](int x) { return (x + 1) / 2 - 1; };
  const auto steps_of = [](int x) { return x % 2 == 0 ? 3 * kSteps / 4 : kSteps / 4; };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      whole.at<cv::Vec2s>(y, x) = {static_cast<int16_t>(whole_of(x)), static_cast<int16_t>(whole_of(y))};
      fraction.at<uint16_t>(y, x) = static_cast<uint16_t>(kSteps * steps_of(y) + steps_of(x));
    }
  }
  return {whole, fraction, original.width_px, original.height_px};
}

CameraCalibration Doubled(CameraCalibration camera) {
  camera.width_px *= 2;
  camera.height_px *= 2;
  camera.fx_px *= 2.0;
  camera.fy_px *= 2.0;
  camera.cx_px = 2.0 * (camera.cx_px + 0.5) - 0.5;
  camera.cy_px = 2.0 * (camera.cy_px + 0.5) - 0.5;
  return camera;
}

class DoubledSource : public FrameSource {
 public:
  explicit DoubledSource(std::unique_ptr<FrameSource> source)
      : source_(std::move(source)),
        calibration_(Doubled(source_->calibration())),
        table_(std::make_shared<const RemapTable>(TableOf(source_->calibration()))),
        notes_{"the images are small (" + std::to_string(source_->calibration().width_px) + "x" +
               std::to_string(source_->calibration().height_px) + " px): they are doubled (camera.min_focal_px)"} {
    TakeNotes();
  }

  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override { return source_->num_frames(); }
  const std::vector<GroundTruthPose>& ground_truth() const override { return source_->ground_truth(); }
  std::optional<CameraFrame> Next() override {
    std::optional<CameraFrame> frame = source_->Next();
    TakeNotes();
    if (!frame) return frame;
    frame->left = table_->Interpolate(frame->left);
    if (!frame->right.empty()) frame->right = table_->Interpolate(frame->right);
    if (!frame->depth.empty()) frame->depth = table_->Nearest(frame->depth);
    return frame;
  }
  ColorReader TakeColor() override {
    ColorReader read = source_->TakeColor();
    if (!read) return read;
    return [table = table_, read = std::move(read)] {
      ColorImage image = read();
      return image.empty() ? image : table->Interpolate(image);
    };
  }
  bool HasNext() override { return source_->HasNext(); }
  void SkipTo(FrameId frame) override { source_->SkipTo(frame); }
  bool is_live() const override { return source_->is_live(); }
  std::vector<std::string> TakeEvents() override { return source_->TakeEvents(); }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string loss() const override { return source_->loss(); }

 private:
  // Those that came since; the first is its own.
  void TakeNotes() {
    const std::vector<std::string>& all = source_->notes();
    notes_.insert(notes_.end(), all.begin() + static_cast<ptrdiff_t>(notes_.size() - 1), all.end());
  }

  const std::unique_ptr<FrameSource> source_;
  const CameraCalibration calibration_;
  const std::shared_ptr<const RemapTable> table_;  // color readers, which may outlive a live source, have it too
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<FrameSource> DoubleIfSmall(std::unique_ptr<FrameSource> source, double min_focal_px) {
  const bool is_small = source->calibration().fx_px < min_focal_px;
  return is_small ? std::make_unique<DoubledSource>(std::move(source)) : std::move(source);
}

}  // namespace tessera
