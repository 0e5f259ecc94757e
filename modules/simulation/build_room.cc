// A furnished room.
#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

class RoomBuilder {
 public:
  RoomBuilder(const Eigen::Vector3d& room_m, uint32_t seed, World& world)
      : half_x_(0.5 * room_m.x()), half_z_(0.5 * room_m.z()), height_(room_m.y()), builder_(world), random_(seed) {}

  void Build() {
    BuildShell();
    const Eigen::Vector2d corners[] = {
        {-half_x_, -half_z_}, {-half_x_, half_z_}, {half_x_, half_z_}, {half_x_, -half_z_}};
    for (int i = 0; i < 4; ++i) {
      Furnish(corners[i], corners[(i + 1) % 4]);
    }
    // A table in the middle with things on it.
    PutTable({random_.Uniform(-0.3, 0.3), random_.Uniform(-0.3, 0.3)}, 0.5, 0.35);
  }

 private:
  int32_t Paint(Material material, double width, double height, double texel = 0.004) {
    return builder_.AddPaint({material, random_.Next(), width, height, texel});
  }

  void BuildShell() {
    const double x = half_x_;
    const double z = half_z_;
    const Eigen::Vector2d a(-x, -z), b(-x, z), c(x, z), d(x, -z);
    const auto wall = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
      builder_.Add(builder_.Wall(from, to, 0.0, height_, Paint(Material::kWallpaper, (to - from).norm(), height_)));
    };
    // Seen from inside.
    wall(a, b);
    wall(b, c);
    wall(c, d);
    wall(d, a);
    builder_.Add({{-x, 0.0, -z}, {2 * x, 0.0, 0.0}, {0.0, 0.0, 2 * z}, Paint(Material::kWood, 2 * x, 2 * z), 0.9F});
    builder_.Add({{-x, -height_, z},
                  {2 * x, 0.0, 0.0},
                  {0.0, 0.0, -2 * z},
                  Paint(Material::kCeiling, 2 * x, 2 * z, 0.02),
                  0.95F});
  }

  // Shelves, cupboards and boxes along the wall from `from` to `to`, posters and shelves of books above.
  void Furnish(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double length = (to - from).norm();
    const Eigen::Vector2d along = (to - from) / length;
    const Eigen::Vector2d inwards = RightOf(along);
    for (double position = 0.5; position + 0.5 < length;) {
      const double width = random_.Uniform(0.4, 1.3);
      if (position + width + 0.4 > length) break;
      const Eigen::Vector2d middle = from + (position + 0.5 * width) * along;
      const double draw = random_.Uniform(0.0, 1.0);
      if (draw < 0.3) {
        PutCupboard(middle, along, inwards, width, random_.Uniform(1.6, 2.1), Material::kBooks);
      } else if (draw < 0.65) {
        const double top = random_.Uniform(0.6, 1.0);
        PutCupboard(middle, along, inwards, width, top, Material::kPoster);
        PutThings(middle + 0.25 * inwards, top, 0.4 * width, along);
        Hang(middle, along, inwards, 0.9 * width);
      } else {
        Hang(middle, along, inwards, width);
      }
      position += width + random_.Uniform(0.05, 0.5);
    }
  }

  void PutCupboard(const Eigen::Vector2d& at_wall, const Eigen::Vector2d& along, const Eigen::Vector2d& inwards,
                   double width, double height, Material front) {
    const double depth = random_.Uniform(0.3, 0.5);
    const Eigen::Vector2d middle = at_wall + 0.5 * depth * inwards;
    const int32_t face = Paint(front, width, height);
    const int32_t side = Paint(Material::kWood, depth, height);
    builder_.Add(builder_.Box(middle, along, 0.5 * width, 0.5 * depth, 0.0, height, face, side));
    builder_.Add(builder_.Lid(middle, along, 0.5 * width, 0.5 * depth, height, Paint(Material::kWood, depth, width)));
  }

  void PutThings(const Eigen::Vector2d& middle, double height, double reach, const Eigen::Vector2d& along) {
    const int num_things = 1 + random_.Index(3);
    for (int i = 0; i < num_things; ++i) {
      const double half = random_.Uniform(0.04, 0.14);
      const double tall = random_.Uniform(0.08, 0.4);
      const Eigen::Vector2d position = middle + random_.Uniform(-reach, reach) * along;
      const int32_t face = Paint(Material::kPoster, 2.0 * half, tall, 0.003);
      builder_.Add(builder_.Box(position, along, half, half, height, tall, face, face));
      builder_.Add(builder_.Lid(position, along, half, half, height + tall, face));
    }
  }

  void PutTable(const Eigen::Vector2d& middle, double half_length, double half_width) {
    const Eigen::Vector2d along(1.0, 0.0);
    const int32_t edge = Paint(Material::kWood, 2.0 * half_length, 0.74);
    builder_.Add(builder_.Box(middle, along, half_length, half_width, 0.0, 0.74, edge, edge));
    builder_.Add(builder_.Lid(middle, along, half_length, half_width, 0.74,
                              Paint(Material::kPoster, 2.0 * half_width, 2.0 * half_length)));
    PutThings(middle, 0.74, 0.3, along);
  }

  void Hang(const Eigen::Vector2d& at_wall, const Eigen::Vector2d& along, const Eigen::Vector2d& inwards,
            double width) {
    const double height = random_.Uniform(0.4, 0.9);
    const double bottom = random_.Uniform(1.1, 1.4);
    const Eigen::Vector2d middle = at_wall + 0.015 * inwards;
    builder_.Add(builder_.Wall(middle - 0.45 * width * along, middle + 0.45 * width * along, bottom, height,
                               Paint(Material::kPoster, 0.9 * width, height)));
  }

  double half_x_, half_z_, height_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

World BuildRoom(const Eigen::Vector3d& room_m, uint32_t seed) {
  World world;
  RoomBuilder(room_m, seed, world).Build();
  return world;
}

}  // namespace tessera
