#include "datasets/doubled_source.h"

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>

#include "datasets/changed_source.h"
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

std::string NoteOf(const CameraCalibration& original) {
  return "the images are small (" + std::to_string(original.width_px) + "x" + std::to_string(original.height_px) +
         " px): they are doubled (camera.min_focal_px)";
}

class DoubledSource : public ChangedSource {
 public:
  DoubledSource(std::unique_ptr<FrameSource> original, std::string note)
      : ChangedSource(std::move(original), std::move(note)),
        calibration_(Doubled(source().calibration())),
        table_(std::make_shared<const RemapTable>(TableOf(source().calibration()))) {}

  const CameraCalibration& calibration() const override { return calibration_; }
  ColorReader TakeColor() override {
    ColorReader read = source().TakeColor();
    if (!read) return read;
    return [table = table_, read = std::move(read)] {
      ColorImage image = read();
      return image.empty() ? image : table->Interpolate(image);
    };
  }

 private:
  void Change(CameraFrame& frame) const override {
    frame.left = table_->Interpolate(frame.left);
    if (!frame.right.empty()) frame.right = table_->Interpolate(frame.right);
    if (!frame.depth.empty()) frame.depth = table_->Nearest(frame.depth);
  }

  const CameraCalibration calibration_;
  const std::shared_ptr<const RemapTable> table_;  // color readers, which may outlive a live source, have it too
};

}  // namespace

std::unique_ptr<FrameSource> DoubleIfSmall(std::unique_ptr<FrameSource> source, double min_focal_px) {
  const bool is_small = source->calibration().fx_px < min_focal_px;
  if (!is_small) return source;
  std::string note = NoteOf(source->calibration());
  return std::make_unique<DoubledSource>(std::move(source), std::move(note));
}

}  // namespace tessera
