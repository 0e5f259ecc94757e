#include "datasets/pose_track.h"

namespace tessera {

std::optional<Rigid3> PoseTrack::At(int64_t time_ns) const {
  const auto after = poses_.lower_bound(time_ns);
  if (after == poses_.end()) {
    return std::nullopt;
  }
  if (after->first == time_ns) {
    return after->second;
  }
  if (after == poses_.begin()) {
    return std::nullopt;
  }
  const auto before = std::prev(after);
  const int64_t gap_ns = after->first - before->first;
  if (gap_ns > kMaxGapNs) {
    return std::nullopt;
  }
  const double fraction = static_cast<double>(time_ns - before->first) / static_cast<double>(gap_ns);
  return Interpolate(before->second, after->second, fraction);
}

}  // namespace tessera
