// A desk at the wall of a room, full of things; shelves and a chair around it.
#include <cmath>

#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

constexpr double kTopM = 0.72;        // height of the desk
constexpr double kHalfLengthM = 0.8;  // of the desk, along x
constexpr double kBackM = 0.5;        // z of its far edge and of the wall behind
constexpr double kFrontM = -0.35;     // z of its near edge
const Eigen::Vector2d kAhead(1.0, 0.0);

class DeskBuilder {
 public:
  DeskBuilder(uint32_t seed, double near_m, double half_width_m, World& world)
      : near_m_(near_m), half_width_m_(half_width_m), builder_(world), random_(HashOf(seed, 73)) {}

  void Build() {
    BuildShell();
    BuildDesk();
    PutMonitor(random_.Uniform(-0.25, 0.05));
    PutFlatThings();
    PutThings();
    BuildSurroundings();
  }

 private:
  int32_t Paint(Material material, double width, double height, double texel = 0.002) {
    return builder_.AddPaint({material, random_.Next(), width, height, texel});
  }

  void BuildShell() {
    constexpr double kHeight = 2.5;
    const double x = half_width_m_;
    const Eigen::Vector2d a(-x, -near_m_), b(-x, kBackM + 0.02), c(x, kBackM + 0.02), d(x, -near_m_);
    const auto wall = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
      builder_.Add(
          builder_.Wall(from, to, 0.0, kHeight, Paint(Material::kWallpaper, (to - from).norm(), kHeight, 0.005)));
    };
    wall(a, b);
    wall(b, c);
    wall(c, d);
    wall(d, a);
    const double depth = b.y() - a.y();
    builder_.Add({{-x, 0.0, -near_m_},
                  {2.0 * x, 0.0, 0.0},
                  {0.0, 0.0, depth},
                  Paint(Material::kCarpet, 2.0 * x, depth, 0.005),
                  0.8F});
    builder_.Add({{-x, -kHeight, b.y()},
                  {2.0 * x, 0.0, 0.0},
                  {0.0, 0.0, -depth},
                  Paint(Material::kCeiling, 2.0 * x, depth, 0.02),
                  0.95F});
  }

  // A box with a lid.
  void PutBox(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, const Eigen::Vector3d& half_m, double bottom,
              Material material) {
    const double height = 2.0 * half_m.y();
    const int32_t side = Paint(material, 2.0 * half_m.x(), height);
    const int32_t end = Paint(material, 2.0 * half_m.z(), height);
    builder_.Add(builder_.Box(middle, ahead, half_m.x(), half_m.z(), bottom, height, side, end));
    builder_.Add(builder_.Lid(middle, ahead, half_m.x(), half_m.z(), bottom + height,
                              Paint(material, 2.0 * half_m.z(), 2.0 * half_m.x())));
  }

  Eigen::Vector2d Turned(double most) {
    const double t = random_.Uniform(-most, most);
    return Eigen::Vector2d(1.0, t).normalized();
  }

  void BuildDesk() {
    const double middle_z = 0.5 * (kBackM + kFrontM), half_depth = 0.5 * (kBackM - kFrontM);
    PutBox({0.0, middle_z}, kAhead, {kHalfLengthM, 0.015, half_depth}, kTopM - 0.03, Material::kCarRoof);
    for (const double x : {-kHalfLengthM + 0.2, kHalfLengthM - 0.2}) {
      PutBox({x, middle_z}, kAhead, {0.18, 0.34, half_depth - 0.05}, 0.0, Material::kWood);
    }
  }

  void PutMonitor(double x) {
    PutBox({x, 0.28}, kAhead, {0.1, 0.01, 0.09}, kTopM, Material::kCarRoof);
    PutBox({x, 0.3}, kAhead, {0.03, 0.07, 0.02}, kTopM, Material::kBark);
    // A dark screen that shows a few windows.
    PutBox({x, 0.28}, kAhead, {0.27, 0.17, 0.02}, kTopM + 0.12, Material::kScreen);
  }

  // Paper, a keyboard, thin books: hardly higher than the desk.
  void PutFlatThings() {
    PutBox({random_.Uniform(-0.2, 0.05), -0.1}, Turned(0.1), {0.22, 0.01, 0.07}, kTopM, Material::kKeys);
    for (int i = 0; i < 9; ++i) {
      const double x = random_.Uniform(-0.7, 0.7);
      const Eigen::Vector2d middle(x, random_.Uniform(-0.26, 0.3));
      const bool is_paper = random_.Chance(0.6);
      const Eigen::Vector3d half(0.105, is_paper ? 0.001 + 0.0005 * i : random_.Uniform(0.006, 0.02), 0.148);
      PutBox(middle, Turned(0.5), half, kTopM, is_paper ? Material::kPaper : Material::kPackage);
    }
  }

  void PutThings() {
    for (int i = 0; i < 12; ++i) {
      const double side = random_.Chance(0.5) ? 1.0 : -1.0;
      const double x = side * random_.Uniform(0.32, 0.74);
      const Eigen::Vector2d middle(x, random_.Uniform(-0.15, 0.42));
      const double half_x = random_.Uniform(0.03, 0.1);
      const double half_y = random_.Uniform(0.03, 0.12);
      const double half_z = random_.Uniform(0.03, 0.08);
      const Material material = random_.Chance(0.7) ? Material::kPackage : Material::kCarRoof;
      PutBox(middle, Turned(0.6), {half_x, half_y, half_z}, kTopM, material);
    }
    // A lamp.
    const double x = random_.Uniform(0.5, 0.7);
    PutBox({x, 0.4}, kAhead, {0.012, 0.25, 0.012}, kTopM, Material::kBark);
    PutBox({x, 0.34}, kAhead, {0.06, 0.04, 0.1}, kTopM + 0.5, Material::kCarRoof);
  }

  // Pictures and shelves on the walls, a chair, boxes on the floor.
  void BuildSurroundings() {
    for (const double x : {-1.7, -0.9, 0.75, 1.6}) {
      const double half = random_.Uniform(0.15, 0.3);
      const double height = random_.Uniform(0.3, 0.6);
      builder_.Add(builder_.Wall({x - half, kBackM}, {x + half, kBackM}, random_.Uniform(1.1, 1.5), height,
                                 Paint(Material::kPoster, 2.0 * half, height)));
    }
    for (const double side : {-1.0, 1.0}) {
      PutBox({(half_width_m_ - 0.2) * side, random_.Uniform(-1.0, -0.2)}, {0.0, 1.0}, {0.6, 0.9, 0.17}, 0.0,
             Material::kBooks);
      PutBox({(half_width_m_ - 0.25) * side, random_.Uniform(-2.4, -1.9)}, {0.0, 1.0}, {0.3, 0.35, 0.2}, 0.0,
             Material::kPackage);
    }
    PutBox({random_.Uniform(0.35, 0.6), -0.75}, Turned(0.4), {0.22, 0.03, 0.22}, 0.42, Material::kCarpet);
    PutBox({random_.Uniform(-1.3, -1.1), 0.2}, Turned(0.3), {0.2, 0.2, 0.15}, 0.0, Material::kPackage);
  }

  double near_m_, half_width_m_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

World BuildDesk(uint32_t seed, double near_m, double half_width_m) {
  World world;
  DeskBuilder(seed, near_m, half_width_m, world).Build();
  return world;
}

}  // namespace tessera
