// A hall full of machines, lit by a few lamps.
#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

constexpr double kHalfXM = 7.0, kHalfZM = 5.5, kHeightM = 5.0;
constexpr double kDark = 0.12;    // of full light, away from all lamps
constexpr double kReachM = 2.2;   // of a lamp's light
constexpr double kPanelM = 2.75;  // walls, floor and ceiling are made of squares of about this size

class HallBuilder {
 public:
  HallBuilder(uint32_t seed, World& world) : builder_(world), random_(HashOf(seed, 75)) {
    // The corners of the hall stay dark, but for two of them.
    const double side = random_.Chance(0.5) ? 1.0 : -1.0;
    lamps_ = {{{side * random_.Uniform(3.0, 5.0), random_.Uniform(1.5, 4.0)},
               {random_.Uniform(-1.0, 1.0), random_.Uniform(-1.0, 1.0)},
               {-side * random_.Uniform(3.5, 5.5), random_.Uniform(-4.0, -2.0)}}};
  }

  void Build() {
    BuildShell();
    const std::array<Eigen::Vector2d, 4> corners{
        {{-kHalfXM, -kHalfZM}, {-kHalfXM, kHalfZM}, {kHalfXM, kHalfZM}, {kHalfXM, -kHalfZM}}};
    for (size_t i = 0; i < corners.size(); ++i) PutAlong(corners[i], corners[(i + 1) % corners.size()]);
    PutMachine({random_.Uniform(-0.2, 0.2), random_.Uniform(-0.2, 0.2)}, {1.0, 0.0}, {0.8, 1.1, 0.5});
    PutPipes();
  }

 private:
  int32_t Paint(Material material, double width, double height, double texel = 0.006) {
    return builder_.AddPaint({material, random_.Next(), width, height, texel});
  }

  float LightAt(const Eigen::Vector3d& point) const {
    double light = kDark;
    for (const Eigen::Vector2d& lamp : lamps_) {
      const double squared = (Eigen::Vector2d(point.x(), point.z()) - lamp).squaredNorm();
      light += 1.0 / (1.0 + squared / (kReachM * kReachM));
    }
    return static_cast<float>(std::min(1.0, light));
  }

  void Add(Surface surface) {
    surface.brightness *= LightAt(surface.Center());
    builder_.Add(surface);
  }
  void Add(const std::vector<Surface>& surfaces) {
    for (const Surface& surface : surfaces) Add(surface);
  }

  // A wall, floor or ceiling, square by square.
  void AddPanels(const Surface& whole, Material material, double texel) {
    const int columns = std::max(1, static_cast<int>(std::lround(whole.across.norm() / kPanelM)));
    const int rows = std::max(1, static_cast<int>(std::lround(whole.up.norm() / kPanelM)));
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        Surface panel = whole;
        panel.across /= columns;
        panel.up /= rows;
        panel.corner += column * panel.across + row * panel.up;
        panel.paint = Paint(material, panel.across.norm(), panel.up.norm(), texel);
        Add(panel);
      }
    }
  }

  void BuildShell() {
    const double x = kHalfXM, z = kHalfZM;
    const std::array<Eigen::Vector2d, 4> corners{{{-x, -z}, {-x, z}, {x, z}, {x, -z}}};
    for (size_t i = 0; i < corners.size(); ++i) {
      const Material material = i % 2 == 0 ? Material::kNoiseBarrier : Material::kWallpaper;
      AddPanels(builder_.Wall(corners[i], corners[(i + 1) % corners.size()], 0.0, kHeightM, 0), material, 0.008);
    }
    AddPanels({{-x, 0.0, -z}, {2.0 * x, 0.0, 0.0}, {0.0, 0.0, 2.0 * z}, 0, 0.8F}, Material::kCarpet, 0.008);
    AddPanels({{-x, -kHeightM, z}, {2.0 * x, 0.0, 0.0}, {0.0, 0.0, -2.0 * z}, 0, 0.6F}, Material::kCeiling, 0.02);
  }

  // Machines, shelves and crates along a wall.
  void PutAlong(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double length = (to - from).norm();
    const Eigen::Vector2d along = (to - from) / length;
    const Eigen::Vector2d inwards = RightOf(along);
    for (double position = 0.8; position + 0.8 < length;) {
      const double width = random_.Uniform(0.5, 2.0);
      if (position + width + 0.6 > length) break;
      const double half_depth = random_.Uniform(0.25, 0.6);
      const double gap = random_.Uniform(0.02, 0.3);
      PutMachine(from + (position + 0.5 * width) * along + (half_depth + gap) * inwards, along,
                 {0.5 * width, random_.Uniform(0.6, 2.6), half_depth});
      position += width + random_.Uniform(0.1, 1.0);
    }
    // A pillar, and signs above.
    const Eigen::Vector2d pillar = from + random_.Uniform(0.4, 0.6) * length * along + 1.4 * inwards;
    const int32_t steel = Paint(Material::kCarRoof, 0.3, kHeightM);
    Add(builder_.Box(pillar, along, 0.15, 0.15, 0.0, kHeightM, steel, steel));
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d left = from + random_.Uniform(0.1, 0.85) * length * along + 0.02 * inwards;
      const double width = random_.Uniform(0.3, 1.0), height = random_.Uniform(0.3, 0.8);
      const double bottom = random_.Uniform(2.4, 3.8);
      Add(builder_.Wall(left, left + width * along, bottom, height, Paint(Material::kPoster, width, height)));
    }
  }

  // half_m: along, height, across.
  void PutMachine(const Eigen::Vector2d& middle, const Eigen::Vector2d& along, const Eigen::Vector3d& half_m) {
    constexpr std::array kFronts{Material::kPackage, Material::kBooks, Material::kCarSide, Material::kPoster,
                                 Material::kPackage};
    const Material material = kFronts[static_cast<size_t>(random_.Index(kFronts.size()))];
    const double length = 2.0 * half_m.x(), height = half_m.y(), depth = 2.0 * half_m.z();
    const int32_t front = Paint(material, length, height);
    Add(builder_.Box(middle, along, half_m.x(), half_m.z(), 0.0, height, front,
                     Paint(Material::kPackage, depth, height)));
    Add(builder_.Lid(middle, along, half_m.x(), half_m.z(), height, Paint(Material::kPackage, depth, length)));
    if (half_m.x() < 0.4 || !random_.Chance(0.6)) return;
    const double top = random_.Uniform(0.2, 0.7);
    const int32_t box = Paint(Material::kPackage, 0.4, top);
    const Eigen::Vector2d on_top = middle + random_.Uniform(-0.5, 0.5) * half_m.x() * along;
    Add(builder_.Box(on_top, along, 0.2, 0.15, height, top, box, box));
    Add(builder_.Lid(on_top, along, 0.2, 0.15, height + top, box));
  }

  // Under the ceiling, along x and along z.
  void PutPipes() {
    for (int i = 0; i < 6; ++i) {
      const bool is_long = i % 2 == 0;
      const double half_length = (is_long ? kHalfXM : kHalfZM) - 0.1;
      const double aside = random_.Uniform(-0.9, 0.9) * (is_long ? kHalfZM : kHalfXM);
      const double bottom = random_.Uniform(3.6, 4.6), thick = random_.Uniform(0.05, 0.18);
      const Eigen::Vector2d along = is_long ? Eigen::Vector2d(1.0, 0.0) : Eigen::Vector2d(0.0, 1.0);
      const Eigen::Vector2d across = RightOf(along);
      // In pieces, each with its own light.
      const int pieces = static_cast<int>(half_length);
      for (int k = 0; k < pieces; ++k) {
        const double half = half_length / pieces;
        const Eigen::Vector2d middle = aside * across + ((2 * k + 1) * half - half_length) * along;
        const int32_t paint = Paint(Material::kBark, 2.0 * half, 2.0 * thick);
        Add(builder_.Box(middle, along, half, thick, bottom, 2.0 * thick, paint, paint));
        // Seen from below.
        const Eigen::Vector2d corner = middle - half * along + thick * across;
        const Eigen::Vector2d up = -2.0 * thick * across;
        Surface below{{corner.x(), -bottom, corner.y()},
                      {2.0 * half * along.x(), 0.0, 2.0 * half * along.y()},
                      {up.x(), 0.0, up.y()},
                      paint,
                      0.5F};
        below.two_sided = true;
        Add(below);
      }
    }
  }

  WorldBuilder builder_;
  Random random_;
  std::array<Eigen::Vector2d, 3> lamps_;  // over these places
};

}  // namespace

World BuildHall(uint32_t seed) {
  World world;
  HallBuilder(seed, world).Build();
  return world;
}

}  // namespace tessera
