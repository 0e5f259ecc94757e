#include "simulation/depth_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "simulation/random.h"

namespace tessera {
namespace {

constexpr int kBorderPx = 8;         // half the window of the matcher
constexpr int kCellPx = 3;           // neighbors share a window, and so their error
constexpr float kEdgeRatio = 1.03F;  // of inverse depths on both sides of an edge

class Measurement {
 public:
  Measurement(const Rendering& rendering, const CameraCalibration& camera, const DepthSensor& sensor, uint32_t seed)
      : rendering_(rendering), camera_(camera), sensor_(sensor), seed_(seed) {}

  // The inverse depth that is measured at this pixel, 1/m; 0: none. `is_lit`: the pattern reaches it.
  double At(int x, int y, const std::vector<bool>& is_lit) const;
  // Which pixels of a row the projector lights: a point at column u is at column u + f b w of its picture, and behind
  // a nearer one if another point to the left of it lies farther right there.
  std::vector<bool> LitOf(int y) const;

 private:
  float InverseDepth(int x, int y) const {
    return rendering_.inverse_depth.row(
        std::clamp(y, 0, camera_.height_px - 1))[std::clamp(x, 0, camera_.width_px - 1)];
  }
  // Of the cell that holds the pixel, in [0, 1); another for each `kind`.
  double Chance(int x, int y, uint32_t kind) const {
    return static_cast<double>(
        UnitOf(HashOf(seed_, kind, static_cast<uint32_t>(x / kCellPx), static_cast<uint32_t>(y / kCellPx))));
  }
  bool IsEdge(float a, float b) const { return std::max(a, b) > kEdgeRatio * std::min(a, b); }
  double CosineAt(int x, int y, float w) const;

  const Rendering& rendering_;
  const CameraCalibration& camera_;
  const DepthSensor& sensor_;
  uint32_t seed_;
};

std::vector<bool> Measurement::LitOf(int y) const {
  std::vector<bool> is_lit(static_cast<size_t>(camera_.width_px));
  double farthest_right = -1e9;
  for (int x = 0; x < camera_.width_px; ++x) {
    const double column = x + camera_.fx_px * sensor_.baseline_m * static_cast<double>(InverseDepth(x, y));
    is_lit[static_cast<size_t>(x)] = column > farthest_right;
    farthest_right = std::max(farthest_right, column);
  }
  return is_lit;
}

// On a plane w = n . (x, y, 1) / const, so that n follows from the gradient of w; the smaller difference to a neighbor
// doesn't cross an edge.
double Measurement::CosineAt(int x, int y, float w) const {
  const auto smaller = [](double a, double b) { return std::abs(a) < std::abs(b) ? a : b; };
  const auto difference = [&](int dx, int dy) {
    return smaller(static_cast<double>(InverseDepth(x + dx, y + dy) - w),
                   static_cast<double>(w - InverseDepth(x - dx, y - dy)));
  };
  const double a = camera_.fx_px * difference(1, 0);
  const double b = camera_.fy_px * difference(0, 1);
  const Eigen::Vector3d ray = camera_.Ray(Eigen::Vector2d(x, y));
  const Eigen::Vector3d normal(a, b, static_cast<double>(w) - a * ray.x() - b * ray.y());
  return static_cast<double>(w) / (normal.norm() * ray.norm());
}

double Measurement::At(int x, int y, const std::vector<bool>& is_lit) const {
  const float own = InverseDepth(x, y);
  if (own <= 0.0F || !is_lit[static_cast<size_t>(x)]) return 0.0;
  const double gray = rendering_.radiance.row(y)[x] / 256.0;
  // Twice as bright as what returns mostly nothing returns enough.
  if (gray < sensor_.dark_gray * (1.0 + Chance(x, y, 91))) return 0.0;
  // Not sharp: within 0.15 of the limit more and more is lost.
  if (CosineAt(x, y, own) < sensor_.steep_cosine + 0.15 * Chance(x, y, 92)) return 0.0;
  // Along edges a window may hold more of what lies on the other side.
  const int dx = static_cast<int>(5.0 * Chance(x, y, 93)) - 2;
  const int dy = static_cast<int>(5.0 * Chance(x, y, 94)) - 2;
  const float other = InverseDepth(x + dx, y + dy);
  if (!IsEdge(own, other)) return static_cast<double>(own);
  return Chance(x, y, 95) < 0.4 ? 0.0 : static_cast<double>(other);
}

}  // namespace

DepthImage MeasureDepth(const Rendering& rendering, const CameraCalibration& camera, const DepthSensor& sensor,
                        uint32_t seed, uint32_t picture) {
  DepthImage depth(camera.width_px, camera.height_px);
  const uint32_t own_seed = HashOf(seed, 35, picture);
  const Measurement measurement(rendering, camera, sensor, own_seed);
  for (int y = 0; y < depth.height; ++y) {
    const std::vector<bool> is_lit = measurement.LitOf(y);
    for (int x = kBorderPx; x < depth.width - kBorderPx; ++x) {
      const double w = measurement.At(x, y, is_lit);
      if (w <= 0.0) continue;
      const float noise =
          NormalOf(HashOf(own_seed, 96, static_cast<uint32_t>(x / kCellPx), static_cast<uint32_t>(y / kCellPx)));
      const double disparity = sensor.focal_baseline_px_m * w + sensor.disparity_noise_px * static_cast<double>(noise);
      const double steps = std::floor(disparity / sensor.disparity_step_px + 0.5);
      if (steps < 1.0) continue;
      const double z = sensor.focal_baseline_px_m / (steps * sensor.disparity_step_px);
      if (z < sensor.nearest_m || z > sensor.farthest_m) continue;
      const double counts = z / camera.depth_unit_m + 0.5;
      if (counts < 65536.0) depth.row(y)[x] = static_cast<uint16_t>(counts);
    }
  }
  return depth;
}

}  // namespace tessera
