#include "measurement/depth_delay.h"

#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr double kRadius_px = 24.0;  // two keypoints' distances; a fast turn moves an image by as much in 15 ms
constexpr size_t kMaxNeighbors = 48;
constexpr size_t kMinNeighbors = 4;
// Of the inverse depth. What differs by more belongs to another surface; what is off the plane by more than the second
// has little to say about it.
constexpr double kMaxStep = 0.1;
constexpr double kSoftStep = 0.01;
constexpr int kNumRounds = 2;
// Neighbors side by side say nothing of the slope across: one more as far away as this, with the same depth.
constexpr double kLevelAt_px = 5.0;
constexpr double kMinShift_px = 0.2;       // nothing to correct
constexpr double kMaxBlindShift_px = 3.0;  // without a surface, a depth of so far beside is worth nothing
constexpr double kMaxChange = 2.0;         // of the inverse depth; more comes from a plane seen from its edge

// Keypoints around one: how far they are from it, and by which share their inverse depth differs.
struct Neighbors {
  std::array<double, kMaxNeighbors> x_px, y_px, step;
  size_t size = 0;
};

// Of the step, per pixel: least squares, in which what doesn't fit counts less from round to round.
Eigen::Vector2d FitSlope(const Neighbors& neighbors) {
  double slope_x = 0.0, slope_y = 0.0;
  std::array<double, kMaxNeighbors> weights;
  for (int round = 0; round < kNumRounds; ++round) {
    for (size_t i = 0; i < neighbors.size; ++i) {
      const double off_plane = neighbors.step[i] - slope_x * neighbors.x_px[i] - slope_y * neighbors.y_px[i];
      weights[i] = kSoftStep * kSoftStep / (kSoftStep * kSoftStep + off_plane * off_plane);
    }
    double xx = kLevelAt_px * kLevelAt_px, yy = xx, xy = 0.0, x_step = 0.0, y_step = 0.0;
    for (size_t i = 0; i < neighbors.size; ++i) {
      const double weighted_x = weights[i] * neighbors.x_px[i], weighted_y = weights[i] * neighbors.y_px[i];
      xx += weighted_x * neighbors.x_px[i];
      xy += weighted_x * neighbors.y_px[i];
      yy += weighted_y * neighbors.y_px[i];
      x_step += weighted_x * neighbors.step[i];
      y_step += weighted_y * neighbors.step[i];
    }
    const double determinant = xx * yy - xy * xy;
    slope_x = (yy * x_step - xy * y_step) / determinant;
    slope_y = (xx * y_step - xy * x_step) / determinant;
  }
  return {slope_x, slope_y};
}

}  // namespace

std::optional<Eigen::Vector3d> SurfaceAt(const FrameView& view, int keypoint) {
  const CameraCalibration& camera = view.calibration();
  const Eigen::Vector2d pixel_px = view.pixel(keypoint);
  const auto depth = static_cast<double>(view.keypoint(keypoint).depth_m);
  Neighbors neighbors;
  view.grid().VisitWindow(pixel_px, kRadius_px, PatchRange{}, [&](const PlacedKeypoint& placed) {
    const auto depth_beside = static_cast<double>(view.keypoint(placed.index).depth_m);
    if (placed.index == keypoint || depth_beside <= 0.0 || neighbors.size == kMaxNeighbors) return;
    const double step = depth / depth_beside - 1.0;
    if (std::abs(step) > kMaxStep) return;
    neighbors.x_px[neighbors.size] = static_cast<double>(placed.x_px) - pixel_px.x();
    neighbors.y_px[neighbors.size] = static_cast<double>(placed.y_px) - pixel_px.y();
    neighbors.step[neighbors.size++] = step;
  });
  if (neighbors.size < kMinNeighbors) return std::nullopt;
  const Eigen::Vector2d slope = FitSlope(neighbors) / depth;
  const Eigen::Vector3d ray = camera.Ray(pixel_px);
  const double a_x = camera.fx_px * slope.x(), a_y = camera.fy_px * slope.y();
  return Eigen::Vector3d(a_x, a_y, 1.0 / depth - a_x * ray.x() - a_y * ray.y());
}

Eigen::Vector3d SurfaceIn(const Rigid3& here_from_there, const Eigen::Vector3d& surface_here) {
  return here_from_there.rotation.conjugate() * surface_here / (1.0 - surface_here.dot(here_from_there.translation));
}

// Of SurfaceIn(), for the steps of a short time: a + dt (a x turn_rate + a (a . velocity)).
double InverseDepthRate(const Eigen::Vector3d& surface, const Eigen::Vector3d& ray, const CameraMotion& motion) {
  return surface.cross(motion.turn_rate).dot(ray) + surface.dot(motion.velocity) * surface.dot(ray);
}

DepthSurfaces SurfacesOf(const FrameView& view) {
  DepthSurfaces surfaces(static_cast<size_t>(view.size()));
  for (int i = 0; i < view.size(); ++i) {
    if (view.keypoint(i).depth_m > 0.0F) surfaces[static_cast<size_t>(i)] = SurfaceAt(view, i);
  }
  return surfaces;
}

FeatureFrame WithDepthsOfImage(const FrameView& view, const DepthSurfaces& surfaces, double delay_s,
                               const CameraMotion& motion) {
  FeatureFrame features = view.features();
  features.depth_delay_us = 0;
  const CameraCalibration& camera = view.calibration();
  const Rigid3 depth_from_image = Rigid3{ExpSO3(delay_s * motion.turn_rate), delay_s * motion.velocity}.Inverse();
  for (int i = 0; i < view.size(); ++i) {
    float& depth_m = features.keypoints[static_cast<size_t>(i)].depth_m;
    const auto measured = static_cast<double>(depth_m);
    if (measured <= 0.0) continue;
    const Eigen::Vector3d ray = camera.Ray(view.pixel(i));
    const Eigen::Vector3d later = depth_from_image * Eigen::Vector3d(measured * ray);
    if (later.z() < kMinDepth) continue;
    const double shift_px = (camera.Project(later) - view.pixel(i)).norm();
    if (shift_px < kMinShift_px) continue;
    if (const std::optional<Eigen::Vector3d>& surface = surfaces[static_cast<size_t>(i)]) {
      const double change = measured * SurfaceIn(depth_from_image, *surface).dot(ray);
      if (change > 1.0 / kMaxChange && change < kMaxChange) depth_m = static_cast<float>(measured / change);
    } else if (shift_px > kMaxBlindShift_px) {
      depth_m = 0.0F;
    }
  }
  return features;
}

}  // namespace tessera
