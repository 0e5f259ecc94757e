#include "datasets/video_input.h"

#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <vector>

#include "core/errors.h"
#include "datasets/color_pixels.h"

namespace tessera {

// Of a network stream: one that stalls for less is waited for, which is quicker than to connect anew.
constexpr int kReadTimeoutMs = 10'000, kOpenTimeoutMs = 10'000;

struct VideoInput::Impl {
  cv::VideoCapture capture;
  cv::Mat image;
  cv::Mat gray;
};

VideoInput::VideoInput(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoInput::VideoInput(VideoInput&&) noexcept = default;
VideoInput::~VideoInput() = default;

VideoInput VideoInput::OpenFile(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError("video " + path + " does not exist: check the path");
  }
  auto impl = std::make_unique<Impl>();
  if (!impl->capture.open(path)) {
    throw InputError("video " + path + " can't be opened: it is damaged or of a format that OpenCV does not read");
  }
  return VideoInput(std::move(impl));
}

VideoInput VideoInput::OpenDevice(int index, int width_px, int height_px) {
  auto impl = std::make_unique<Impl>();
  if (!impl->capture.open(index, cv::CAP_V4L2)) {
    throw InputError(
        "camera /dev/video" + std::to_string(index) +
        " can't be opened: check that it is plugged in, not in use, and that you may read it (group video)");
  }
  if (width_px > 0 && height_px > 0) {
    impl->capture.set(cv::CAP_PROP_FRAME_WIDTH, width_px);
    impl->capture.set(cv::CAP_PROP_FRAME_HEIGHT, height_px);
  }
  return VideoInput(std::move(impl));
}

VideoInput VideoInput::OpenUrl(const std::string& url) {
  auto impl = std::make_unique<Impl>();
  const std::vector<int> time_outs{cv::CAP_PROP_OPEN_TIMEOUT_MSEC, kOpenTimeoutMs, cv::CAP_PROP_READ_TIMEOUT_MSEC,
                                   kReadTimeoutMs};
  if (!impl->capture.open(url, cv::CAP_FFMPEG, time_outs)) {
    throw InputError("stream " + url + " can't be opened: check the address and that the camera answers");
  }
  return VideoInput(std::move(impl));
}

std::optional<GrayImage> VideoInput::Read() {
  if (!impl_->capture.read(impl_->image) || impl_->image.empty()) {
    return std::nullopt;
  }
  if (impl_->image.channels() == 1) {
    impl_->gray = impl_->image;
  } else {
    cv::cvtColor(impl_->image, impl_->gray, cv::COLOR_BGR2GRAY);
  }
  if (impl_->gray.type() != CV_8UC1) {
    throw InputError("the video has images of more than 8 bits a channel: convert it to 8 bits");
  }
  GrayImage image;
  image.width = impl_->gray.cols;
  image.height = impl_->gray.rows;
  image.pixels.reserve(impl_->gray.total());
  for (int y = 0; y < image.height; ++y) {
    const uint8_t* row = impl_->gray.ptr(y);
    image.pixels.insert(image.pixels.end(), row, row + image.width);
  }
  return image;
}

ColorReader VideoInput::ColorOfLast() const {
  if (impl_->image.type() != CV_8UC3) return nullptr;
  return [image = impl_->image.clone()] { return ColorsOf(image); };  // the next one takes its place
}

bool VideoInput::Skip() { return impl_->capture.grab(); }

int64_t VideoInput::num_images() const {
  const double count = impl_->capture.get(cv::CAP_PROP_FRAME_COUNT);
  return std::isfinite(count) && count > 0.0 && count < 1e12 ? std::llround(count) : 0;
}

double VideoInput::frames_per_s() const {
  const double rate = impl_->capture.get(cv::CAP_PROP_FPS);
  return std::isfinite(rate) && rate > 0.0 ? rate : 0.0;
}

double VideoInput::position_ms() const {
  const double position = impl_->capture.get(cv::CAP_PROP_POS_MSEC);
  return std::isfinite(position) && position > 0.0 ? position : 0.0;
}

}  // namespace tessera
