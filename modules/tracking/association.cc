#include "tracking/association.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMinDepth = 1e-6;
constexpr double kMinViewCosine = 0.5;  // patches seen more obliquely than 60 degrees look too different

// The keypoint that shows the landmark, if one clearly does.
BestMatch FindKeypoint(const LocalLandmark& landmark, const Projection& expected, const FrameView& frame,
                       double radius_px) {
  BestMatch best;
  frame.grid().VisitWindow(expected.pixel_px, radius_px, [&](int32_t i) {
    if (std::abs(frame.keypoint(i).level - expected.level) > 1) {
      return;
    }
    // Comparisons with a column that is not known are false, as they should be.
    if (std::abs(frame.right_x_px(i) - expected.right_x_px) > radius_px) {
      return;
    }
    best.Offer(i, HammingDistance(landmark.descriptor, frame.descriptor(i)));
  });
  return best;
}

}  // namespace

LocalLandmark MakeLocalLandmark(LandmarkId id, const OdometryLandmark& landmark) {
  return {id, landmark.position_in_world, landmark.covariance, landmark.normal, landmark.reach, landmark.descriptor};
}

std::optional<Projection> ProjectLandmark(const LocalLandmark& landmark, const Rigid3& camera_from_world,
                                          const FrameView& frame) {
  const CameraCalibration& calibration = frame.calibration();
  const Eigen::Vector3d point = camera_from_world * landmark.position_in_world;
  if (point.z() < kMinDepth) {
    return std::nullopt;
  }
  Projection projection;
  projection.pixel_px = calibration.Project(point);
  const Eigen::Vector2d& p = projection.pixel_px;
  if (!(p.x() >= 0.0 && p.y() >= 0.0 && p.x() < calibration.width_px && p.y() < calibration.height_px)) {
    return std::nullopt;
  }
  const double distance = point.norm();
  const Eigen::Vector3d normal_in_camera = camera_from_world.rotation * landmark.normal;
  const double level = std::log(landmark.reach / distance) / std::log(kLevelScale);
  constexpr double kMaxExpectedLevel = 12.0;  // beyond every pyramid
  if (-point.dot(normal_in_camera) < kMinViewCosine * distance || level < -1.5 || level > kMaxExpectedLevel) {
    return std::nullopt;
  }
  projection.level = static_cast<int>(std::lround(std::max(level, 0.0)));
  if (frame.baseline_m() > 0.0) {
    projection.right_x_px = p.x() - calibration.fx_px * frame.baseline_m() / point.z();
  }
  return projection;
}

Associations AssociateByProjection(std::span<const LocalLandmark> landmarks, const Rigid3& camera_from_world,
                                   const FrameView& frame, const AssociationOptions& options) {
  Associations result;
  result.is_expected.assign(landmarks.size(), 0);
  for (size_t i = 0; i < landmarks.size(); ++i) {
    const std::optional<Projection> expected = ProjectLandmark(landmarks[i], camera_from_world, frame);
    if (!expected) {
      continue;
    }
    result.is_expected[i] = 1;
    const double radius_px = options.radius_px * ScaleOfLevel(expected->level);
    const BestMatch best = FindKeypoint(landmarks[i], *expected, frame, radius_px);
    if (best.IsClear(options.matching)) {
      result.matches.push_back({static_cast<int32_t>(i), best.index, best.distance});
    }
  }
  result.matches = KeepBestPerSecond(std::move(result.matches), frame.size());
  return result;
}

}  // namespace tessera
