// The start of a part of a mono map: the first one, or one after a loss.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "tracking/ground_watch.h"
#include "tracking/initializer.h"

namespace tessera {

// How far the camera goes, if something is known of that.
struct KnownSpeed {
  double before_loss = 0.0;                 // units/s; 0: unknown
  std::optional<int64_t> tracked_utime_us;  // of the last frame with a pose
};

class PartStart {
 public:
  using Frame = std::shared_ptr<const FrameView>;

  explicit PartStart(const InitializerOptions& options) : options_(options), initializer_(options) {}

  // Forgets the frames that Add() has seen.
  void Restart() { initializer_ = MonoInitializer(options_); }
  // Two frames that together give a motion and points, and become keyframes, `first` being the older one's number. They
  // don't know how far apart they are: as far as the ground tells, or as the camera goes in that time, if it still
  // moves as it did when it was lost. That is a guess until the ground tells it or a loop joins the parts.
  std::optional<MonoStart> Add(const Frame& view, const KnownSpeed& speed, KeyframeId first, GroundWatch& ground);

 private:
  InitializerOptions options_;
  MonoInitializer initializer_;
};

}  // namespace tessera
