#include "datasets/doubled_source.h"

#include <algorithm>
#include <string>
#include <utility>

namespace tessera {
namespace {

// The pixels on both sides of a sample along one axis; `near` counts three times as much.
struct Neighbors {
  int near = 0;
  int far = 0;
};

Neighbors NeighborsOf(int doubled, int size) {
  const int near = doubled / 2, far = doubled % 2 == 0 ? near - 1 : near + 1;
  return {near, std::clamp(far, 0, size - 1)};
}

uint8_t Blend(uint8_t near_near, uint8_t near_far, uint8_t far_near, uint8_t far_far) {
  return static_cast<uint8_t>((9 * near_near + 3 * near_far + 3 * far_near + far_far + 8) / 16);
}

Rgb Blend(const Rgb& near_near, const Rgb& near_far, const Rgb& far_near, const Rgb& far_far) {
  return {.red = Blend(near_near.red, near_far.red, far_near.red, far_far.red),
          .green = Blend(near_near.green, near_far.green, far_near.green, far_far.green),
          .blue = Blend(near_near.blue, near_far.blue, far_near.blue, far_far.blue)};
}

template <class Pixel>
Image<Pixel> Blended(const Image<Pixel>& image) {
  if (image.empty()) return {};
  Image<Pixel> doubled(2 * image.width, 2 * image.height);
  for (int y = 0; y < doubled.height; ++y) {
    const Neighbors rows = NeighborsOf(y, image.height);
    const Pixel *near = image.row(rows.near), *far = image.row(rows.far);
    Pixel* out = doubled.row(y);
    for (int x = 0; x < doubled.width; ++x) {
      const Neighbors columns = NeighborsOf(x, image.width);
      out[x] = Blend(near[columns.near], near[columns.far], far[columns.near], far[columns.far]);
    }
  }
  return doubled;
}

DepthImage Repeated(const DepthImage& image) {
  DepthImage doubled(2 * image.width, 2 * image.height);
  for (int y = 0; y < doubled.height; ++y) {
    for (int x = 0; x < doubled.width; ++x) doubled.row(y)[x] = image.row(y / 2)[x / 2];
  }
  return doubled;
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
      : source_(std::move(source)), calibration_(Doubled(source_->calibration())) {
    Renew();
  }

  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override { return source_->num_frames(); }
  const std::vector<GroundTruthPose>& ground_truth() const override { return source_->ground_truth(); }
  std::optional<CameraFrame> Next() override {
    std::optional<CameraFrame> frame = source_->Next();
    Renew();
    if (!frame) return frame;
    frame->left = Blended(frame->left);
    frame->right = Blended(frame->right);
    frame->depth = Repeated(frame->depth);
    return frame;
  }
  ColorReader TakeColor() override {
    ColorReader read = source_->TakeColor();
    if (!read) return read;
    return [read = std::move(read)] { return Blended(read()); };
  }
  bool HasNext() override { return source_->HasNext(); }
  void SkipTo(FrameId frame) override { source_->SkipTo(frame); }
  bool is_live() const override { return source_->is_live(); }
  std::vector<std::string> TakeEvents() override { return source_->TakeEvents(); }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string loss() const override { return source_->loss(); }

 private:
  // The source's notes may have become more.
  void Renew() {
    if (!notes_.empty() && notes_.size() == source_->notes().size() + 1) return;
    notes_ = {"the images are small (" + std::to_string(source_->calibration().width_px) + "x" +
              std::to_string(source_->calibration().height_px) + " px): they are doubled (camera.min_focal_px)"};
    notes_.insert(notes_.end(), source_->notes().begin(), source_->notes().end());
  }

  const std::unique_ptr<FrameSource> source_;
  const CameraCalibration calibration_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<FrameSource> DoubleIfSmall(std::unique_ptr<FrameSource> source, double min_focal_px) {
  const bool is_small = source->calibration().fx_px < min_focal_px;
  return is_small ? std::make_unique<DoubledSource>(std::move(source)) : std::move(source);
}

}  // namespace tessera
