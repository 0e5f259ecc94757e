// Poses as rows of text, as the tools of the field read them.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/rigid3.h"

namespace tessera {

// Seconds to the microsecond.
std::string SecondsText(int64_t utime_us);

// TUM: `timestamp tx ty tz qx qy qz qw` with the time in seconds to the microsecond, and a line break.
std::string TumRow(int64_t utime_us, const Rigid3& world_from_camera);

// KITTI: the 3x4 matrix [R | t] row by row, and a line break.
std::string KittiRow(const Rigid3& world_from_camera);

}  // namespace tessera
