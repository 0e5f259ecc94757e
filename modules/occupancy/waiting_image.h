// An image that waits for its turn: in memory, or, where many do, on disk.
#pragma once

#include <cstring>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "core/scratch_file.h"
#include "geometry/camera_frame.h"

namespace tessera {

// Calls visit(image) for each image that the value has room for, in a fixed order.
template <class Frame, class Visit>
  requires std::is_same_v<std::remove_const_t<Frame>, CameraFrame>
void VisitImages(Frame& frame, Visit visit) {
  visit(frame.left);
  visit(frame.right);
  visit(frame.depth);
}
template <class Color, class Visit>
  requires std::is_same_v<std::remove_const_t<Color>, ColorImage>
void VisitImages(Color& image, Visit visit) {
  visit(image);
}

// Of all pixels.
template <class Images>
int64_t BytesOf(const Images& images) {
  size_t sum = 0;
  VisitImages(images, [&](const auto& image) { sum += image.pixels.size() * sizeof(image.pixels[0]); });
  return static_cast<int64_t>(sum);
}

// `Images`: CameraFrame or ColorImage.
template <class Images>
struct WaitingImage {
  Images images;                            // without pixels while they are on disk
  std::optional<ScratchFile::Place> place;  // where they are there

  int64_t bytes_in_memory() const { return BytesOf(images); }
};

// False if the disk does not take it: then it stays in memory.
template <class Images>
bool MoveToDisk(WaitingImage<Images>& waiting, ScratchFile& file) {
  if (waiting.place) return true;
  std::string bytes;
  bytes.reserve(static_cast<size_t>(BytesOf(waiting.images)));
  VisitImages(waiting.images, [&](const auto& image) {
    bytes.append(reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size() * sizeof(image.pixels[0]));
  });
  waiting.place = file.Put(bytes);
  if (waiting.place) VisitImages(waiting.images, [](auto& image) { image.pixels = {}; });
  return waiting.place.has_value();
}

// nullopt if the disk does not give it back.
template <class Images>
std::optional<Images> MoveBack(WaitingImage<Images> waiting, ScratchFile* file) {
  if (!waiting.place) return std::move(waiting.images);
  const std::optional<std::string> bytes = file->Take(*waiting.place);
  if (!bytes) return std::nullopt;
  size_t at = 0;
  VisitImages(waiting.images, [&](auto& image) {
    image.pixels.resize(static_cast<size_t>(image.width) * static_cast<size_t>(image.height));
    const size_t num_bytes = image.pixels.size() * sizeof(image.pixels[0]);
    if (num_bytes > 0) std::memcpy(image.pixels.data(), bytes->data() + at, num_bytes);
    at += num_bytes;
  });
  return std::move(waiting.images);
}

}  // namespace tessera
