// People who walk around in a room. Their legs and arms swing by sliding: no joint turns.
#include <array>

#include "simulation/drive.h"
#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

const Eigen::Vector2d kOrigin(0.0, 0.0), kAhead(0.0, 1.0);
constexpr double kNearestM = 0.35;  // to a camera

class PeopleBuilder {
 public:
  PeopleBuilder(double duration_s, uint32_t seed, World& world)
      : duration_s_(duration_s), world_(world), builder_(world), random_(HashOf(seed, 81)) {}

  void Build(int num_people) {
    for (int i = 0; i < num_people; ++i) AddPerson(i % 2 == 0 ? 1.0 : -1.0);
    if (num_people > 0) AddChair();
  }

 private:
  // Round after round before the desk, in this direction; no two are alike.
  Polyline PlanWay(double direction, double length_m) {
    Polyline way;
    for (double walked_m = 0.0; walked_m < length_m; walked_m = LengthOf(way)) {
      for (size_t quarter = 0; quarter < 4; ++quarter) {
        for (const double part : {0.0, 0.5}) {
          const Eigen::Vector2d on_circle =
              OnCircle(direction > 0.0 ? quarter : 3 - quarter, direction > 0.0 ? part : 1.0 - part);
          const double half_x = random_.Uniform(1.2, 1.9), half_z = random_.Uniform(0.3, 0.55);
          way.emplace_back(half_x * on_circle.x(), -1.25 + half_z * on_circle.y());
        }
      }
    }
    return Resample(way, kMoverStepM);
  }

  void AddPerson(double direction) {
    const double length_m = 1.3 * duration_s_ + 10.0;
    const Polyline way = PlanWay(direction, length_m);
    // Somewhere in the first round, two of three stand there at first.
    CarMotion motion{.cruise_mps = random_.Uniform(0.8, 1.3), .acceleration_mps2 = 1.2};
    double at_m = random_.Uniform(1.0, 6.0);
    motion.waits.push_back({at_m, 0.0});
    const double stands_s = random_.Uniform(-2.0, 5.0);
    while ((at_m += random_.Uniform(3.0, 8.0)) < length_m) {
      motion.waits.push_back({at_m, random_.Uniform(1.0, 4.0)});
    }
    const double begin_m = motion.waits.front().at_m;
    const auto walk = std::make_shared<const CarTrajectory>(way, 1.0, random_.Next(), motion);
    const double begin_s = walk->wait_times_s().front();
    const uint32_t seed = random_.Next();
    // Who stands sways a little.
    const auto walked_m = [=](double time_s) {
      const double since_s = time_s - std::max(0.0, stands_s);
      const double sway_m = 0.02 * SmoothNoise(seed, 0.4 * time_s);
      return sway_m + (since_s < 0.0 ? begin_m : walk->DistanceAt(begin_s + since_s));
    };
    const auto swing = [=](double reach_m, uint32_t limb) {
      return [=](double time_s) {
        constexpr double kTwoStepsM = 1.4;
        const double at = walked_m(time_s);
        const double gesture_m = limb < 2 ? 0.0 : 0.08 * SmoothNoise(HashOf(seed, limb), 0.8 * time_s);
        return at + reach_m * Wave(at / kTwoStepsM) + gesture_m;
      };
    };
    const double tall_m = random_.Uniform(1.6, 1.9);
    const double hips_m = 0.5 * tall_m, shoulders_m = tall_m - 0.3;
    const uint32_t shirt = random_.Next(), trousers = random_.Next();
    const auto send = [&](const std::function<double(double)>& position_m, std::vector<Surface> body) {
      world_.movers.push_back({way, position_m, std::move(body), kNearestM});
    };
    std::vector<Surface> torso = Block(0.0, {0.22, 0.13}, hips_m, shoulders_m, Material::kCloth, shirt);
    const std::vector<Surface> head =
        Block(0.0, {0.08, 0.1}, shoulders_m + 0.05, tall_m, Material::kPackage, shirt + 1);
    torso.insert(torso.end(), head.begin(), head.end());
    send(walked_m, torso);
    uint32_t limb = 0;
    for (const double side : {-1.0, 1.0}) {
      send(swing(0.25 * side, limb), Block(0.11 * side, {0.085, 0.09}, 0.0, hips_m, Material::kCloth, trousers));
      send(swing(-0.2 * side, limb + 2),
           Block(0.28 * side, {0.05, 0.055}, hips_m - 0.05, shoulders_m, Material::kCloth, shirt + 2));
      ++limb;
    }
  }

  // An upright box so far to the right, with its half width and thickness.
  std::vector<Surface> Block(double right_m, const Eigen::Vector2d& half_m, double bottom_m, double top_m,
                             Material material, uint32_t seed) {
    constexpr double kTexelM = 0.004;
    const double height_m = top_m - bottom_m;
    const auto paint = [&](double width_m, double tall_m) {
      return builder_.AddPaint({material, seed, width_m, tall_m, kTexelM});
    };
    const Eigen::Vector2d middle(right_m, 0.0);
    std::vector<Surface> block = builder_.Box(middle, kAhead, half_m.y(), half_m.x(), bottom_m, height_m,
                                              paint(2.0 * half_m.y(), height_m), paint(2.0 * half_m.x(), height_m));
    block.push_back(
        builder_.Lid(middle, kAhead, half_m.y(), half_m.x(), top_m, paint(2.0 * half_m.x(), 2.0 * half_m.y())));
    return block;
  }

  // It stands beside the desk and is pushed along it once.
  void AddChair() {
    const double z = random_.Uniform(-0.75, -0.6), moves_s = random_.Uniform(0.3, 0.6) * duration_s_;
    const double side = random_.Chance(0.5) ? 1.0 : -1.0;
    const uint32_t seed = random_.Next();
    Mover chair;
    chair.way = Resample({{-1.9 * side, z}, {1.9 * side, z}}, kMoverStepM);
    chair.position_m = [=](double time_s) { return 1.1 + 0.9 * Ease((time_s - moves_s) / 1.5); };
    chair.body = Block(0.0, {0.22, 0.22}, 0.0, 0.45, Material::kPackage, seed);
    const std::vector<Surface> back = Block(-0.2, {0.03, 0.22}, 0.45, 0.95, Material::kPoster, seed + 1);
    chair.body.insert(chair.body.end(), back.begin(), back.end());
    chair.gap_m = kNearestM;
    world_.movers.push_back(std::move(chair));
  }

  double duration_s_;
  World& world_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

void AddPeople(int num_people, double duration_s, uint32_t seed, World& world) {
  PeopleBuilder(duration_s, seed, world).Build(num_people);
}

}  // namespace tessera
