#include "tracking/capture_times.h"

#include <cmath>
#include <utility>
#include <vector>

#include "core/time_units.h"

namespace tessera {
namespace {

// Of two frames, for their poses to tell how the camera moved while an image was read.
constexpr double kMaxFrameInterval_s = 0.07;
constexpr double kMinDelay_s = 0.001;  // of depths: in less, a turn moves an image by less than a pixel

std::optional<CameraMotion> MeanMotion(const std::optional<CaptureTimes::Step>& step) {
  if (!step || step->interval_s > kMaxFrameInterval_s) return std::nullopt;
  return MotionOver(step->last_from_current, step->interval_s);
}

}  // namespace

CapturedFrame CaptureTimes::Captured(const FeatureFrame& features, const LensCorrection& lens) const {
  CapturedFrame captured{.view = std::make_shared<const FrameView>(WithLens(features, lens))};
  const double delay_s = SecondsOf(features.depth_delay_us) + depth_delay_.delay_s();
  if (std::abs(delay_s) >= kMinDelay_s) {
    captured.depth_delay_s = delay_s;
    captured.surfaces = SurfacesOf(*captured.view);
  }
  return captured;
}

CaptureTimes::Frame CaptureTimes::AtOneTime(const CapturedFrame& captured, const TrackedFrame& last) const {
  return Moved(captured, last, TrackedFrame(captured.view), mean_motion_);
}

CaptureTimes::Frame CaptureTimes::AtOneTime(const CapturedFrame& captured, const TrackedFrame& last,
                                            const TrackedFrame& tracked, const std::optional<Step>& step) const {
  return Moved(captured, last, tracked, MotionAtEnd(step));
}

void CaptureTimes::Follow(const std::optional<Step>& step) {
  motion_ = MotionAtEnd(step);
  mean_motion_ = MeanMotion(step);
}

void CaptureTimes::Learn(const TrackedFrame& tracked, const Rigid3& world_from_reference) {
  if (!motion_ || !motion_at_reference_) return;
  const MovingView reference{world_from_reference, *motion_at_reference_};
  readout_.Add(tracked, *motion_, reference);
  depth_delay_.Add(tracked, *motion_, reference);
}

void CaptureTimes::ForgetMotion() {
  mean_motion_.reset();
  motion_.reset();
  motion_at_reference_.reset();
}

// The mean motion is that of half an interval ago.
std::optional<CameraMotion> CaptureTimes::MotionAtEnd(const std::optional<Step>& step) const {
  std::optional<CameraMotion> motion = MeanMotion(step);
  if (!motion || !mean_motion_) return motion;
  motion->velocity += 0.5 * (motion->velocity - mean_motion_->velocity);
  motion->turn_rate += 0.5 * (motion->turn_rate - mean_motion_->turn_rate);
  return motion;
}

CaptureTimes::Frame CaptureTimes::Moved(const CapturedFrame& captured, const TrackedFrame& last,
                                        const TrackedFrame& tracked, const std::optional<CameraMotion>& motion) const {
  const bool is_rolling = readout().is_rolling(), is_late = captured.depth_delay_s != 0.0;
  if (!motion || (!is_rolling && !is_late)) return captured.view;
  FeatureFrame features = is_late
                              ? WithDepthsOfImage(*captured.view, captured.surfaces, captured.depth_delay_s, *motion)
                              : captured.view->features();
  return std::make_shared<const FrameView>(is_rolling ? Unrolled(features, last, tracked, *motion)
                                                      : std::move(features));
}

FeatureFrame CaptureTimes::Unrolled(const FeatureFrame& rolled, const TrackedFrame& last, const TrackedFrame& tracked,
                                    const CameraMotion& motion) const {
  const Rigid3 camera_from_world = tracked.world_from_camera.Inverse();
  std::vector<double> depths(tracked.points.size(), last.MedianDepth());
  for (size_t i = 0; i < depths.size(); ++i) {
    const auto measured_m = static_cast<double>(rolled.keypoints[i].depth_m);
    if (tracked.points[i].valid()) {
      depths[i] = (camera_from_world * tracked.points[i].landmark.position_in_world).z();
    } else if (measured_m > 0.0) {
      depths[i] = measured_m;
    }
  }
  return Unroll(rolled, depths, readout(), motion);
}

}  // namespace tessera
