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

std::optional<double> LengthOf(const MonoStart& start, const KnownSpeed& speed, GroundWatch& ground) {
  const double interval_s = start.interval_s();
  if (interval_s <= 0.0) return std::nullopt;
  std::optional<double> length;
  if (speed.tracked_utime_us) {
    const double gap_s = SecondsOf(start.first->features().utime_us - *speed.tracked_utime_us);
    length = ground.LengthAfterGap(*start.first, *start.second, start.second_from_first.Inverse(), interval_s,
                                   std::max(gap_s, 0.0));
  }
  if (!length && speed.before_loss > 0.0) length = speed.before_loss * interval_s;
  return length;
}

}  // namespace

std::optional<MonoStart> PartStart::Add(const Frame& view, const KnownSpeed& speed, GroundWatch& ground) {
  std::optional<MonoStart> start = initializer_.Add(view);
  if (!start) return std::nullopt;
  Restart();
  if (const std::optional<double> length = LengthOf(*start, speed, ground)) {
    Scale(*length / start->second_from_first.translation.norm(), *start);
  } else {
    ground.ForgetHeight();
  }
  return start;
}

}  // namespace tessera
