#include "loop_closing/gap_motion.h"

#include "core/time_units.h"

namespace tessera {
namespace {

double SecondsBetween(const Keyframe& first, const Keyframe& second) {
  return SecondsOf(second.features->utime_us - first.features->utime_us);
}

// In the axes of `first`, per second.
struct Velocity {
  Eigen::Vector3d way;
  Eigen::Vector3d turn_rad;
};

Velocity Between(const Keyframe& first, const Keyframe& second) {
  const Rigid3 step = first.world_from_camera.Inverse() * second.world_from_camera;
  const double seconds = SecondsBetween(first, second);
  return {step.translation / seconds, LogSO3(step.rotation) / seconds};
}

}  // namespace

std::optional<GapMotion> MotionAcrossGap(const Keyframe& earlier, const Keyframe& before, const Keyframe& after,
                                         const Keyframe& later) {
  const double gap_s = SecondsBetween(before, after);
  for (const double seconds : {SecondsBetween(earlier, before), gap_s, SecondsBetween(after, later)}) {
    if (!(seconds > 0.0 && seconds <= kMaxGap_s)) return std::nullopt;
  }
  const Velocity first = Between(earlier, before), second = Between(after, later);
  const double speed_before = first.way.norm(), speed_after = second.way.norm();
  if (!(speed_before > 0.0 && speed_after > 0.0)) return std::nullopt;
  const Eigen::Vector3d turn_rad = 0.5 * gap_s * (first.turn_rad + second.turn_rad);
  const bool has_scale = before.features->calibration.sensor == SensorType::kMono;
  GapMotion motion;
  motion.before_from_after = {has_scale ? speed_before / speed_after : 1.0, ExpSO3(turn_rad),
                              gap_s * (ExpSO3(0.5 * turn_rad) * first.way)};
  const double way_sigma = kSpeedChange * gap_s * speed_after, turn_sigma = kTurnChange_rad_s * gap_s;
  motion.covariance.diagonal().head<3>().setConstant(way_sigma * way_sigma);
  motion.covariance.diagonal().segment<3>(3).setConstant(turn_sigma * turn_sigma);
  motion.covariance(6, 6) = kSpeedChange * kSpeedChange;
  return motion;
}

}  // namespace tessera
