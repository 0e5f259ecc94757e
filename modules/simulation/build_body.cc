// What carries the camera, as far as the camera sees it.
#include <array>

#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {

void AddBody(const CameraCalibration& camera, double share, double reach_m, uint32_t seed, World& world) {
  Random random(HashOf(seed, 61));
  WorldBuilder builder(world);
  const double texel_m = 0.002 * reach_m;
  // A top that falls a little ahead: its far edge is seen at the share's row, its near one below the image.
  const double far_m = reach_m, near_m = 0.4 * reach_m, half_width_m = 0.45 * reach_m;
  const double far_y_m = ((1.0 - share) * camera.height_px - camera.cy_px) / camera.fy_px * far_m;
  const double near_y_m = far_y_m - 0.02 * reach_m;
  // The point at this part of the width (-1 to 1), and of the way from the near edge to the far one.
  const auto at = [&](double side, double ahead, double above_m) -> Eigen::Vector3d {
    return {side * half_width_m, near_y_m + ahead * (far_y_m - near_y_m) - above_m, near_m + ahead * (far_m - near_m)};
  };
  const auto put = [&](const Eigen::Vector3d& corner, const Eigen::Vector3d& across, const Eigen::Vector3d& up,
                       Material material) {
    const int32_t paint = builder.AddPaint({material, random.Next(), across.norm(), up.norm(), texel_m});
    world.body.push_back({.corner = corner, .across = across, .up = up, .paint = paint, .two_sided = true});
  };
  // A rectangle on the top.
  const auto lay = [&](double left, double right, double near, double far, double above_m, Material material) {
    const Eigen::Vector3d corner = at(left, near, above_m);
    put(corner, at(right, near, above_m) - corner, at(left, far, above_m) - corner, material);
  };
  lay(-1.0, 1.0, 0.0, 1.0, 0.0, Material::kCarRoof);
  // Stickers, vents, lettering.
  constexpr std::array kThings{Material::kSign, Material::kPackage, Material::kKeys, Material::kFence};
  for (const double side : {-0.7, -0.2, 0.3, 0.75}) {
    const double left = side + random.Uniform(-0.1, 0.1);
    const double near = random.Uniform(0.3, 0.7);
    const double width = random.Uniform(0.12, 0.3);
    const Material thing = kThings[static_cast<size_t>(random.Index(static_cast<int>(kThings.size())))];
    lay(left, left + width, near, near + random.Uniform(0.1, 0.25), 0.004 * reach_m, thing);
  }
  // What stands on it: a mascot, a bumper bar or a gripper.
  for (const double side : {random.Uniform(-0.4, -0.1), random.Uniform(0.2, 0.5)}) {
    const double height_m = random.Uniform(0.02, 0.05) * reach_m;
    const double width_m = random.Uniform(0.04, 0.12) * reach_m;
    put(at(side, 0.95, 0.0), {width_m, 0.0, 0.0}, {0.0, -height_m, 0.0}, Material::kSign);
  }
}

}  // namespace tessera
