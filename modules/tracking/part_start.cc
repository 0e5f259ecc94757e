#include "tracking/part_start.h"

#include <algorithm>

#include "core/time_units.h"

namespace tessera {
namespace {

constexpr double kDriftInterval_s = 0.1;

void Scale(double factor, MonoStart& start) {
  start.second_from_first.translation *= factor;
  for (MonoStart::Point& point : start.points) {
    point.point.point_in_world *= factor;
    point.point.covariance *= factor * factor;
  }
}

}  // namespace

void PartStart::BeginAfter(const TrackedFrame& last, const MotionModel& motion, const Sim3& world_from_units) {
  initializer_ = MonoInitializer(options_);
  world_from_start_ = last.world_from_camera;
  drift_.reset();
  const auto moved = motion.Predict(kDriftInterval_s, Eigen::Quaterniond::Identity());
  if (!moved || !moved->is_steady) return;
  drift_ = Drift{world_from_units.scale * moved->last_from_current.translation / kDriftInterval_s,
                 last.view->features().utime_us};
}

std::optional<MonoStart> PartStart::Add(const Frame& view, std::optional<int64_t> tracked_utime_us,
                                        GroundWatch& ground) {
  std::optional<MonoStart> start = initializer_.Add(view);
  if (!start) return std::nullopt;
  initializer_ = MonoInitializer(options_);
  const double interval_s = start->interval_s();
  std::optional<double> length;
  if (tracked_utime_us && interval_s > 0.0) {
    const double gap_s = SecondsOf(start->first->features().utime_us - *tracked_utime_us);
    length = ground.LengthAfterGap(*start->first, *start->second, start->second_from_first.Inverse(), interval_s,
                                   std::max(gap_s, 0.0));
  }
  if (!length && drift_) length = drift_->velocity.norm() * interval_s;
  if (length) {
    Scale(*length / start->second_from_first.translation.norm(), *start);
    GoOn(start->first->features().utime_us);
  } else {
    ground.ForgetHeight();
  }
  return start;
}

// The camera moved on while it was lost.
void PartStart::GoOn(int64_t utime_us) {
  if (!drift_) return;
  const double lost_s = SecondsOf(utime_us - drift_->utime_us);
  world_from_start_ = world_from_start_ * Rigid3{Eigen::Quaterniond::Identity(), drift_->velocity * lost_s};
  drift_.reset();
}

}  // namespace tessera
