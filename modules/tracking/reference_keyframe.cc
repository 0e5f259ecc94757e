#include "tracking/reference_keyframe.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "core/time_units.h"

namespace tessera {
namespace {

// `are_shared`: other frames may see the same points.
PoseInfluences ByPoint(PoseInfluences influences, bool are_shared) {
  for (PointInfluence& influence : influences) {
    if (!are_shared) influence.point = {};
  }
  if (!std::ranges::is_sorted(influences, {}, &PointInfluence::point)) {
    std::ranges::stable_sort(influences, {}, &PointInfluence::point);
  }
  return influences;
}

}  // namespace

void ReferenceKeyframe::RenewPoints(const MapReplica& replica) {
  if (!influences) return;
  for (PointInfluence& influence : *influences) influence.point = replica.Renew(influence.point);
  *influences = ByPoint(std::move(*influences), true);
}

MotionPrior ReferenceKeyframe::ExpectAt(const Rigid3& reference_from_camera, int64_t utime_us) const {
  if (!motion || utime_us <= motion->utime_us) return {};
  const double interval_s = SecondsOf(utime_us - motion->utime_us);
  const auto expected = motion->model.Predict(interval_s, reference_from_camera.rotation);
  if (!expected || !expected->is_steady) return {};
  const Eigen::Matrix3d information = expected->covariance.inverse();
  return {expected->last_from_current.translation, 0.5 * (information + information.transpose())};
}

Matrix6d ReferenceKeyframe::WayCovarianceTo(const TrackedFrame& other, const PoseInfluences& influences_on_other,
                                            const Rigid3& world_from_reference) {
  if (!influences) influences = ByPoint(influences_on_other, false);
  return WayCovariance(*influences, influences_on_other, other.world_from_camera.Inverse() * world_from_reference);
}

// Points of the first one with depth stand where it sees them. What two frames have from points that both see cancels
// between them, if the points err each by itself: those of mono were triangulated by a few keyframes and move with
// these all together, which residuals don't show. There, both errors count in full.
std::optional<PoseInfluences> InfluencesOnReference(const LocalizedFrame& localized, bool begins_part) {
  const bool has_depth = localized.frame.view->baseline_m() > 0.0;
  if (has_depth && begins_part) return PoseInfluences{};
  if (!localized.influences) return std::nullopt;
  return ByPoint(*localized.influences, has_depth);
}

}  // namespace tessera
