// A world of textured parallelograms. World frame: y points down, the ground is y = 0.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "geometry/camera.h"
#include "simulation/drive.h"
#include "simulation/paint.h"
#include "simulation/random.h"
#include "simulation/street_map.h"
#include "simulation/street_plan.h"

namespace tessera {

// The triangle of a surface that is drawn: all of it, a + b <= 1, or a + b >= 1. Hills are made of triangles.
enum class SurfacePart { kWhole, kLower, kUpper };

// The points corner + a * across + b * up with a, b in [0, 1]. The paint's bottom left is at the corner. Seen from the
// side from which `across` points to the right and `up` up; from the other too if two_sided.
struct Surface {
  Eigen::Vector3d corner;
  Eigen::Vector3d across;
  Eigen::Vector3d up;
  int32_t paint = 0;        // index into World::paints
  float brightness = 1.0F;  // of the light that falls on it
  bool two_sided = false;
  SurfacePart part = SurfacePart::kWhole;

  Eigen::Vector3d Center() const { return corner + 0.5 * (across + up); }
  // In the order of its outline.
  std::array<Eigen::Vector3d, 4> Corners() const {
    return {corner, corner + across, corner + across + up, corner + up};
  }
};

// A car, or a part of a person, such as a leg.
struct Mover {
  Polyline way;                              // every kMoverStepM
  std::function<double(double)> position_m;  // along the way, at a time (s); there is none before and behind it
  std::vector<Surface> body;                 // around the origin, facing +z
  double gap_m = 4.5;  // to the middle of its right side: nearer it isn't drawn, so that it can't sit on the camera
};
inline constexpr double kMoverStepM = 0.5;

struct World {
  std::vector<PaintSpec> paints;
  std::vector<Surface> surfaces;
  std::vector<Mover> movers;
  std::shared_ptr<const StreetMap> streets;  // null: a room
  double sight_m = 260.0;                    // surfaces whose center is farther are not drawn, but `far` ones are
  std::vector<Surface> far;                  // sky and skyline
  std::vector<Surface> body;                 // what moves with the camera, in the left camera's frame
};

// The light on a surface with this unit normal: the sun from one side, the sky from above.
float BrightnessOf(const Eigen::Vector3d& normal);

// Adds surfaces and their paints to a world.
class WorldBuilder {
 public:
  explicit WorldBuilder(World& world) : world_(world) {}

  int32_t AddPaint(const PaintSpec& spec);
  // An upright wall from `from` to `to` (seen with `from` on the left), standing on height `bottom_m`.
  Surface Wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double bottom_m, double height_m,
               int32_t paint) const;
  // Four walls around the rectangle with this middle, half sizes along `ahead` and to its right, seen from outside.
  // Paints: of the sides along `ahead`, and of the ends.
  std::vector<Surface> Box(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, double half_length_m,
                           double half_width_m, double bottom_m, double height_m, int32_t sides, int32_t ends) const;
  // The box's lid.
  Surface Lid(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, double half_length_m, double half_width_m,
              double height_m, int32_t paint) const;
  void Add(const Surface& surface) { world_.surfaces.push_back(surface); }
  void Add(const std::vector<Surface>& surfaces);
  World& world() { return world_; }

 private:
  World& world_;
};

// The body of a parked or driving car in the middle of `middle`, facing `ahead`.
std::vector<Surface> BuildCar(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, uint32_t seed,
                              WorldBuilder& builder);

// A bus or a lorry around the origin, facing +z.
std::vector<Surface> BuildLorry(double length_m, Random& random, WorldBuilder& builder);

// What trees of one kind share: they look alike.
struct TreeKind {
  double crown_m, trunk_m, thick_m;  // width and height of the crown, free height of the trunk, half its thickness
  int32_t bark;
  std::array<int32_t, 3> leaves;  // paints of the crown's three planes
};
TreeKind MakeTreeKind(double crown_m, double trunk_m, double thick_m, Random& random, WorldBuilder& builder);
// A trunk and three planes of leaves through it, standing on height `ground_m`.
void PlantTree(const TreeKind& kind, const Eigen::Vector2d& foot, double ground_m, WorldBuilder& builder);

// Three ranges of wooded ridges, the nearest this far from the middle, seen from inside; and clouds above.
void AddRidges(const Eigen::Vector2d& middle, double radius_m, Random& random, WorldBuilder& builder);
void AddClouds(const Eigen::Vector2d& middle, uint32_t seed, WorldBuilder& builder);

// Houses, trees, parked and driving cars along the streets; the drive stays free.
World BuildStreets(const StreetPlan& plan, uint32_t seed);
// Besides, vehicles that cross in front of the waiting car, large ones among them, from both sides; and from 0.4 of the
// way to 0.75 a lorry in front of it, that stops as it does and starts 1.5 s earlier.
void AddTraffic(const StreetPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed, World& world);
// What carries the camera and stands in its picture, over `share` of the height at the bottom and up to `reach_m`
// ahead: a car's bonnet with stickers and vents, or a robot's top with what it bears.
void AddBody(const CameraCalibration& camera, double share, double reach_m, uint32_t seed, World& world);
// A furnished room with its middle at the origin; x, height, z.
World BuildRoom(const Eigen::Vector3d& room_m, uint32_t seed);
// A desk at the origin, 0.72 m high, seen from where z is negative; a room around it, up to `near_m` before the desk
// and twice `half_width_m` wide.
World BuildDesk(uint32_t seed, double near_m = 3.0, double half_width_m = 2.4);
// A hall of 14 x 5 x 11 m around the origin, machines and crates along its walls and one in its middle, pipes under its
// ceiling; three lamps leave most of it dark.
World BuildHall(uint32_t seed);
// Besides, people who walk around before the desk for `duration_s`, stop and go on, and a chair that one of them moves.
void AddPeople(int num_people, double duration_s, uint32_t seed, World& world);

}  // namespace tessera
