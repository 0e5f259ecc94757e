#include "tracking/capture_times.h"

#include <cmath>
#include <utility>
#include <vector>

#include "core/time_units.h"
#include "measurement/right_delay.h"

namespace tessera {
namespace {

// Of two frames, for their poses to tell how the camera moved while an image was read or depths were measured; while it
// waited for the right camera: less accurate, but better than not at all.
constexpr double kMaxFrameInterval_s = 0.07, kMaxPairInterval_s = 0.15;
constexpr double kMinDelay_s = 0.001;  // of depths: in less, a turn moves an image by less than a pixel

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

void CaptureTimes::Learn(const TrackedFrame& tracked, const Rigid3& world_from_reference, const MapReplica& replica) {
  if (!motion_) return;
  const CameraMotion& motion = motion_->motion;
  right_delay_.Add(tracked, motion, replica);
  if (!motion_at_reference_ || !motion_->is_fine() || !motion_at_reference_->is_fine()) return;
  const MovingView reference{world_from_reference, motion_at_reference_->motion};
  readout_.Add(tracked, motion, reference);
  depth_delay_.Add(tracked, motion, reference);
}

void CaptureTimes::BecomeReference(KeyframeId id) {
  motion_at_reference_ = motion_;
  right_delay_.AddKeyframe(id, motion_ ? std::optional(motion_->motion) : std::nullopt);
}

void CaptureTimes::ForgetMotion() {
  mean_motion_.reset();
  motion_.reset();
  motion_at_reference_.reset();
  right_delay_.ForgetMotion();
}

bool CaptureTimes::KnownMotion::is_fine() const { return interval_s <= kMaxFrameInterval_s; }

std::optional<CaptureTimes::KnownMotion> CaptureTimes::MeanMotion(const std::optional<Step>& step) {
  if (!step || step->interval_s > kMaxPairInterval_s) return std::nullopt;
  return KnownMotion{MotionOver(step->last_from_current, step->interval_s), step->interval_s};
}

// The mean motion is that of half an interval ago.
std::optional<CaptureTimes::KnownMotion> CaptureTimes::MotionAtEnd(const std::optional<Step>& step) const {
  std::optional<KnownMotion> known = MeanMotion(step);
  if (!known || !mean_motion_ || known->is_fine() != mean_motion_->is_fine()) return known;
  CameraMotion& motion = known->motion;
  motion.velocity += 0.5 * (motion.velocity - mean_motion_->motion.velocity);
  motion.turn_rate += 0.5 * (motion.turn_rate - mean_motion_->motion.turn_rate);
  return known;
}

CaptureTimes::Frame CaptureTimes::Moved(const CapturedFrame& captured, const TrackedFrame& last,
                                        const TrackedFrame& tracked, const std::optional<KnownMotion>& known) const {
  if (!known) return captured.view;
  const CameraMotion& motion = known->motion;
  const bool is_rolling = known->is_fine() && readout().is_rolling();
  const bool has_late_depths = known->is_fine() && captured.depth_delay_s != 0.0;
  const double right_delay_s = this->right_delay_s();
  if (!is_rolling && !has_late_depths && right_delay_s == 0.0) return captured.view;
  FeatureFrame features = captured.view->features();
  if (has_late_depths) {
    features = WithDepthsOfImage(*captured.view, captured.surfaces, captured.depth_delay_s, motion);
  }
  if (right_delay_s != 0.0) features = WithRightColumnsOfImage(features, right_delay_s, motion);
  if (is_rolling) features = Unrolled(features, last, tracked, motion);
  return std::make_shared<const FrameView>(std::move(features));
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
