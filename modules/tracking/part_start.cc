#include "tracking/part_start.h"

#include <algorithm>

#include "core/time_units.h"

namespace tessera {
namespace {

void Scale(double factor, MonoStart& start) {
  start.second_from_first.translation *= factor;
  for (MonoStart::Point& point : start.points) {
    point.point.point_in_world *= factor;
    point.point.covariance *= factor * factor;
  }
}

std::optional<double> LengthByGround(const MonoStart& start, std::optional<int64_t> tracked_utime_us,
                                     GroundWatch& ground) {
  if (!tracked_utime_us || start.interval_s() <= 0.0) return std::nullopt;
  const double gap_s = SecondsOf(start.first->features().utime_us - *tracked_utime_us);
  return ground.LengthAfterGap(*start.first, *start.second, start.second_from_first.Inverse(), start.interval_s(),
                               std::max(gap_s, 0.0));
}

}  // namespace

std::optional<MonoStart> PartStart::Add(const Frame& view, const KnownSpeed& speed, KeyframeId first,
                                        GroundWatch& ground) {
  std::optional<MonoStart> start = initializer_.Add(view);
  if (!start) return std::nullopt;
  Restart();
  const std::optional<double> by_ground = LengthByGround(*start, speed.tracked_utime_us, ground);
  const double length = by_ground.value_or(speed.before_loss * start->interval_s());
  if (length > 0.0) Scale(length / start->second_from_first.translation.norm(), *start);
  ground.BeginPart(first, !by_ground);
  return start;
}

}  // namespace tessera
