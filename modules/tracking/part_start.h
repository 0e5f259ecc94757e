// The start of a part of the map: the first one, or one after a loss, which begins where the camera was lost.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "geometry/rigid3.h"
#include "matching/point_matching.h"
#include "tracking/ground_watch.h"
#include "tracking/initializer.h"
#include "tracking/motion_model.h"

namespace tessera {

class PartStart {
 public:
  using Frame = std::shared_ptr<const FrameView>;

  explicit PartStart(const InitializerOptions& options) : options_(options), initializer_(options) {}

  // The camera is lost for so long that what comes is another part. `motion`: as it was at the last frame that was
  // tracked; `world_from_units`: its units.
  void BeginAfter(const TrackedFrame& last, const MotionModel& motion, const Sim3& world_from_units);

  // Mono: two frames that together give a motion and points. They don't know how far apart they are: as far as the
  // ground tells, or as the camera goes in that time, if it still moves as it did when it was lost, and on its way from
  // there. That is a guess until a loop joins the parts. `tracked_utime_us`: of the last frame with a pose.
  std::optional<MonoStart> Add(const Frame& view, std::optional<int64_t> tracked_utime_us, GroundWatch& ground);

  // The camera where the part begins.
  const Rigid3& world_from_start() const { return world_from_start_; }

 private:
  // When the camera was lost, if it moved steadily then: a guess at place and scale of the next part.
  struct Drift {
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // units/s, in its own axes
    int64_t utime_us = 0;
  };

  void GoOn(int64_t utime_us);

  InitializerOptions options_;
  MonoInitializer initializer_;
  Rigid3 world_from_start_;
  std::optional<Drift> drift_;  // of the last loss
};

}  // namespace tessera
