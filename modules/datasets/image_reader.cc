#include <filesystem>

#include "core/errors.h"
#include "datasets/image_file.h"
#include "datasets/recording.h"
#include "datasets/video_input.h"

namespace tessera {
namespace {

class ImageFiles : public ImageReader {
 public:
  explicit ImageFiles(std::vector<std::string> paths) : paths_(std::move(paths)) {}
  int64_t num_images() const override { return static_cast<int64_t>(paths_.size()); }
  GrayImage Read(int64_t index) override {
    last_ = index;
    return ReadGrayImage(paths_.at(static_cast<size_t>(index)));
  }
  ColorReader ColorOfLast() override {
    if (!has_color_) return nullptr;
    return [this, path = paths_.at(static_cast<size_t>(last_))] {
      ColorImage color = ReadColorImage(path);
      has_color_ = !color.empty();  // so are the others
      return color;
    };
  }
  std::string Name(int64_t index) const override { return paths_.at(static_cast<size_t>(index)); }

 private:
  std::vector<std::string> paths_;
  int64_t last_ = 0;
  bool has_color_ = true;  // as far as is known
};

class VideoImages : public ImageReader {
 public:
  VideoImages(const std::string& path, int64_t num_images)
      : path_(path),
        video_(VideoInput::OpenFile(path)),
        num_images_(video_.num_images() > 0 ? video_.num_images() : num_images) {}
  int64_t num_images() const override { return num_images_; }
  std::string Name(int64_t index) const override { return path_ + " image " + std::to_string(index); }

  GrayImage Read(int64_t index) override {
    // Decoding all images on the way: seeking lands on the wrong image in some containers.
    for (; next_ < index; ++next_) {
      if (!video_.Skip()) {
        ComplainOfEnd();
      }
    }
    std::optional<GrayImage> image = video_.Read();
    if (!image) {
      ComplainOfEnd();
    }
    ++next_;
    return std::move(*image);
  }
  ColorReader ColorOfLast() override { return video_.ColorOfLast(); }

 private:
  [[noreturn]] void ComplainOfEnd() const {
    throw InputError("video " + path_ + " ends after " + std::to_string(next_) + " of " + std::to_string(num_images_) +
                     " images: it is truncated; copy it again, or ask for fewer frames");
  }

  std::string path_;
  VideoInput video_;
  int64_t num_images_;
  int64_t next_ = 0;
};

}  // namespace

std::unique_ptr<ImageReader> ReadImageFiles(std::vector<std::string> paths) {
  return std::make_unique<ImageFiles>(std::move(paths));
}

std::unique_ptr<ImageReader> ReadVideoImages(const std::string& path, int64_t num_images) {
  return std::make_unique<VideoImages>(path, num_images);
}

void RequireFolder(const std::string& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    throw InputError("there is no folder " + folder + ": check the path of the source");
  }
  const std::filesystem::directory_iterator files(folder, error);
  if (error || files == std::filesystem::directory_iterator()) {
    throw InputError("folder " + folder + " is empty or may not be read: give the folder that holds the data set");
  }
}

}  // namespace tessera
