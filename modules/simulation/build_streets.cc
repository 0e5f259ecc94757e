// A town along given streets: objects are placed by seed, and never in the way of the drive.
#include <algorithm>
#include <cmath>

#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

// A position beside a street.
struct Spot {
  Eigen::Vector2d on_middle;  // the street's middle line
  Eigen::Vector2d along;      // unit; such that `out` is to its right
  Eigen::Vector2d out;        // unit, away from the street
};

class StreetBuilder {
 public:
  StreetBuilder(const StreetPlan& plan, uint32_t seed, World& world)
      : plan_(plan), seed_(seed), world_(world), builder_(world), random_(seed), drive_({plan.drive}) {}

  void Build() {
    BuildGround();
    for (const Polyline& street : plan_.streets) {
      for (const double side : {1.0, -1.0}) {
        BuildHouses(street, side);
        BuildCurbs(street, side);
        BuildVerge(street, side);
        ParkCars(street, side);
      }
    }
    BuildSkyline();
    if (plan_.has_traffic) SendCars();
  }

 private:
  Spot SpotAt(const Polyline& posts, size_t index, double side) const {
    const Eigen::Vector2d& from = posts[index > 0 ? index - 1 : 0];
    const Eigen::Vector2d& to = posts[std::min(index + 1, posts.size() - 1)];
    const Eigen::Vector2d along = side * (to - from).normalized();
    return {posts[index], along, RightOf(along)};
  }

  // Whether a rectangle is off all streets and other houses: every corner and middle of an edge at least `gap_m` from
  // the middle of any street.
  bool IsFree(const Eigen::Vector2d& middle, const Eigen::Vector2d& along, double half_along, double half_out,
              double gap_m) const {
    for (int i = -2; i <= 2; ++i) {
      for (int k = -2; k <= 2; ++k) {
        const Eigen::Vector2d p = middle + 0.5 * i * half_along * along + 0.5 * k * half_out * RightOf(along);
        if (world_.streets->DistanceToStreet(p) < gap_m || drive_.DistanceToStreet(p) < plan_.gap_m) return false;
      }
    }
    const double radius = std::hypot(half_along, half_out);
    return std::none_of(houses_.begin(), houses_.end(), [&](const House& house) {
      return (house.middle - middle).norm() <
             0.9 * std::max(std::min(half_along, half_out), house.inner) + 0.5 * std::min(radius, house.outer);
    });
  }

  void BuildHouses(const Polyline& street, double side) {
    const Polyline posts = Resample(street, 1.0);
    for (size_t i = 2; i + 2 < posts.size();) {
      const double width = random_.Uniform(8.0, 20.0);
      const double depth = random_.Uniform(8.0, 12.0);
      const double setback = kLotLineM + (random_.Chance(0.6) ? random_.Uniform(0.0, 0.8) : random_.Uniform(1.0, 5.0));
      const auto half = static_cast<size_t>(0.5 * width);
      if (i + half >= posts.size()) break;
      const Spot spot = SpotAt(posts, i + half, side);
      const Eigen::Vector2d middle = spot.on_middle + (setback + 0.5 * depth) * spot.out;
      if (IsFree(middle, spot.along, 0.5 * width, 0.5 * depth, kLotLineM - 0.3)) {
        BuildHouse(middle, spot, width, depth);
        i += static_cast<size_t>(width + (random_.Chance(0.5) ? 0.5 : random_.Uniform(2.0, 7.0)));
      } else {
        i += 3;
      }
    }
  }

  void BuildHouse(const Eigen::Vector2d& middle, const Spot& spot, double width, double depth) {
    const double height = random_.Uniform(5.5, 15.0);
    houses_.push_back({middle, 0.5 * std::min(width, depth), 0.5 * std::hypot(width, depth)});
    const uint32_t style = random_.Next();
    const auto paint = [&](double across, double texel) {
      return builder_.AddPaint({Material::kFacade, style, across, height, texel});
    };
    // All faces share the style; a facade on the street is painted finer than what is seen between houses.
    const Eigen::Vector2d along = 0.5 * width * spot.along;
    const Eigen::Vector2d out = 0.5 * depth * spot.out;
    const Eigen::Vector2d a = middle - along - out, b = middle + along - out;
    const Eigen::Vector2d c = middle + along + out, d = middle - along + out;
    // The front looks back to the street; from there `b` is on the left.
    builder_.Add(builder_.Wall(b, a, 0.0, height, paint(width, 0.02)));
    builder_.Add(builder_.Wall(a, d, 0.0, height, paint(depth, 0.03)));
    builder_.Add(builder_.Wall(d, c, 0.0, height, paint(width, 0.06)));
    builder_.Add(builder_.Wall(c, b, 0.0, height, paint(depth, 0.03)));
    BuildBays(b, a, -spot.out, height);
  }

  // Bays and balconies give a facade depth.
  void BuildBays(const Eigen::Vector2d& left, const Eigen::Vector2d& right, const Eigen::Vector2d& out, double height) {
    const double width = (right - left).norm();
    const int num_bays = random_.Index(3);
    for (int i = 0; i < num_bays; ++i) {
      const double half = random_.Uniform(0.6, 1.3);
      const double reach = random_.Uniform(0.25, 0.7);
      const double bottom = random_.Chance(0.5) ? 3.0 : 0.0;
      const double tall = std::min(height - bottom - 1.0, random_.Uniform(1.0, 6.0));
      const double position = random_.Uniform(half, width - half);
      const Eigen::Vector2d middle = left + position * (right - left) / width + 0.5 * reach * out;
      const int32_t paint = builder_.AddPaint({Material::kFacade, random_.Next(), 2.0 * half, tall, 0.02});
      const int32_t side = builder_.AddPaint({Material::kBark, random_.Next(), reach, tall, 0.03});
      const Eigen::Vector2d ahead = (right - left) / width;
      builder_.Add(builder_.Box(middle, ahead, half, 0.5 * reach, bottom, tall, paint, side));
    }
  }

  void BuildCurbs(const Polyline& street, double side) {
    const Polyline posts = Resample(street, 4.0);
    for (size_t i = 0; i + 1 < posts.size(); ++i) {
      const Spot here = SpotAt(posts, i, side);
      const Spot next = SpotAt(posts, i + 1, side);
      const Eigen::Vector2d a = here.on_middle + kCurbM * here.out;
      const Eigen::Vector2d b = next.on_middle + kCurbM * next.out;
      if (world_.streets->DistanceToStreet(a) < kCurbM - 0.1 || world_.streets->DistanceToStreet(b) < kCurbM - 0.1)
        continue;
      const int32_t paint = builder_.AddPaint({Material::kCurb, random_.Next(), 4.0, 0.13, 0.02});
      // Seen from the road, whose side is left of `along`.
      builder_.Add(side > 0.0 ? builder_.Wall(b, a, 0.0, 0.13, paint) : builder_.Wall(a, b, 0.0, 0.13, paint));
    }
  }

  // Trees, lamps, signs, hedges and fences between curb and houses.
  void BuildVerge(const Polyline& street, double side) {
    const Polyline posts = Resample(street, 1.0);
    for (size_t i = 1; i + 1 < posts.size(); i += 2 + static_cast<size_t>(random_.Index(7))) {
      const Spot spot = SpotAt(posts, i, side);
      const Eigen::Vector2d near = spot.on_middle + random_.Uniform(kCurbM + 0.4, kLotLineM - 0.5) * spot.out;
      const Eigen::Vector2d far = spot.on_middle + random_.Uniform(kLotLineM + 1.0, kLotLineM + 4.0) * spot.out;
      const double draw = random_.Uniform(0.0, 1.0);
      if (draw < 0.25) {
        if (IsFree(far, spot.along, 0.5, 0.5, kLotLineM)) PlantTree(far);
      } else if (draw < 0.42) {
        if (IsFree(near, spot.along, 0.2, 0.2, kCurbM + 0.3)) PlantTree(near);
      } else if (draw < 0.7) {
        if (IsFree(near, spot.along, 0.2, 0.2, kCurbM + 0.3)) PutPole(near, spot);
      } else {
        PutFence(spot.on_middle + (kLotLineM + 0.2) * spot.out, spot);
      }
    }
  }

  void PlantTree(const Eigen::Vector2d& foot) {
    const double crown = random_.Uniform(2.5, 5.0);
    const double trunk = random_.Uniform(1.6, 3.0);
    const double thick = random_.Uniform(0.1, 0.25);
    tessera::PlantTree(MakeTreeKind(crown, trunk, thick, random_, builder_), foot, 0.0, builder_);
  }

  void PutPole(const Eigen::Vector2d& foot, const Spot& spot) {
    const double height = random_.Uniform(2.2, 5.5);
    const int32_t metal = builder_.AddPaint({Material::kBark, random_.Next(), 0.12, height, 0.02});
    builder_.Add(builder_.Box(foot, spot.along, 0.06, 0.06, 0.0, height, metal, metal));
    const double half = random_.Uniform(0.25, 0.5);
    const double tall = random_.Uniform(0.4, 0.8);
    const int32_t sign = builder_.AddPaint({Material::kSign, random_.Next(), 2.0 * half, tall, 0.01});
    Surface board = builder_.Wall(foot - half * spot.out + 0.07 * spot.along,
                                  foot + half * spot.out + 0.07 * spot.along, std::min(2.0, height - tall), tall, sign);
    board.two_sided = true;
    builder_.Add(board);
  }

  void PutFence(const Eigen::Vector2d& middle, const Spot& spot) {
    const double half = random_.Uniform(1.5, 3.5);
    if (!IsFree(middle, spot.along, half, 0.3, kLotLineM - 0.3)) return;
    const bool is_hedge = random_.Chance(0.5);
    const double height = random_.Uniform(0.8, 1.7);
    const int32_t paint =
        builder_.AddPaint({is_hedge ? Material::kHedge : Material::kFence, random_.Next(), 2.0 * half, height, 0.02});
    builder_.Add(builder_.Box(middle, spot.along, half, is_hedge ? 0.3 : 0.04, 0.0, height, paint, paint));
  }

  void ParkCars(const Polyline& street, double side) {
    const Polyline posts = Resample(street, 1.0);
    for (size_t i = 4; i + 4 < posts.size(); i += 6 + static_cast<size_t>(random_.Index(12))) {
      const Spot spot = SpotAt(posts, i, side);
      const Eigen::Vector2d middle = spot.on_middle + random_.Uniform(4.6, 4.75) * spot.out;
      // Not across the mouth of another street.
      if (world_.streets->DistanceToStreet(middle) < 4.5 || drive_.DistanceToStreet(middle) < plan_.gap_m + 0.5)
        continue;
      const uint32_t seed = random_.Next();
      const Eigen::Vector2d ahead = random_.Chance(0.9) ? spot.along : Eigen::Vector2d(-spot.along);
      builder_.Add(BuildCar(middle, ahead, seed, builder_));
    }
  }

  void BuildGround() {
    // Fine tiles where the camera comes near, one wide meadow below.
    constexpr double kTileM = 12.0;
    Eigen::Vector2d low(1e9, 1e9);
    Eigen::Vector2d high(-1e9, -1e9);
    for (const Polyline& street : plan_.streets) {
      for (const Eigen::Vector2d& p : street) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
    const auto first = [](double x) { return static_cast<int>(std::floor((x - 14.0) / kTileM)); };
    const auto last = [](double x) { return static_cast<int>(std::floor((x + 14.0) / kTileM)); };
    for (int row = first(low.y()); row <= last(high.y()); ++row) {
      for (int column = first(low.x()); column <= last(high.x()); ++column) {
        const Eigen::Vector2d corner(column * kTileM, row * kTileM);
        const Eigen::Vector2d middle = corner + Eigen::Vector2d::Constant(0.5 * kTileM);
        if (world_.streets->DistanceToStreet(middle) > 18.0) continue;
        const PaintSpec spec{Material::kGround, HashOf(seed_, 5), kTileM, kTileM, 0.025, corner};
        builder_.Add(
            {{corner.x(), 0.0, corner.y()}, {kTileM, 0.0, 0.0}, {0.0, 0.0, kTileM}, builder_.AddPaint(spec), 0.95F});
      }
    }
    const Eigen::Vector2d corner = low - Eigen::Vector2d::Constant(200.0);
    const Eigen::Vector2d extent = high - low + Eigen::Vector2d::Constant(400.0);
    const int32_t grass = builder_.AddPaint({Material::kHedge, HashOf(seed_, 4), extent.x(), extent.y(), 0.5});
    // A little deeper, so that the tiles hide it.
    world_.far.push_back(
        {{corner.x(), 0.05, corner.y()}, {extent.x(), 0.0, 0.0}, {0.0, 0.0, extent.y()}, grass, 0.95F});
  }

  void BuildSkyline() {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& p : plan_.drive) middle += p / static_cast<double>(plan_.drive.size());
    double reach = 0.0;
    for (const Eigen::Vector2d& p : plan_.drive) reach = std::max(reach, (p - middle).norm());
    const double sky_m = 4000.0;
    const int32_t clouds = builder_.AddPaint({Material::kSky, HashOf(seed_, 6), 2.0 * sky_m, 2.0 * sky_m, 8.0});
    // Seen from below: across to the right when looking up along z.
    world_.far.push_back({{middle.x() - sky_m, -350.0, middle.y() + sky_m},
                          {2.0 * sky_m, 0.0, 0.0},
                          {0.0, 0.0, -2.0 * sky_m},
                          clouds,
                          1.0F});
    constexpr int kNumBlocks = 90;
    for (int i = 0; i < kNumBlocks; ++i) {
      // Directions around the circle by an exact rational parametrization of each quarter.
      const double t = random_.Uniform(0.0, 1.0);
      const double c = (1.0 - t * t) / (1.0 + t * t);
      const double s = 2.0 * t / (1.0 + t * t);
      const Eigen::Vector2d quarter[] = {{c, s}, {-s, c}, {-c, -s}, {s, -c}};
      const Eigen::Vector2d out = quarter[i % 4];
      const double distance = reach + random_.Uniform(120.0, 600.0);
      const double half = random_.Uniform(8.0, 30.0);
      const double height = random_.Uniform(10.0, 60.0);
      const int32_t paint = builder_.AddPaint({Material::kSkyline, random_.Next(), 2.0 * half, height, 0.3});
      const std::vector<Surface> block =
          builder_.Box(middle + distance * out, out, half, half, 0.0, height, paint, paint);
      world_.far.insert(world_.far.end(), block.begin(), block.end());
    }
  }

  // Cars on the other lane, against the drive.
  void SendCars() {
    Polyline way = Resample(plan_.drive, kMoverStepM);
    std::reverse(way.begin(), way.end());
    Polyline lane;
    for (size_t i = 0; i < way.size(); ++i) {
      const Eigen::Vector2d along = way[std::min(i + 1, way.size() - 1)] - way[i > 0 ? i - 1 : 0];
      lane.push_back(way[i] + kRoadHalfWidthM * RightOf(along.normalized()));
    }
    const double length = LengthOf(lane);
    for (double position = random_.Uniform(40.0, 100.0); position < length; position += random_.Uniform(90.0, 260.0)) {
      Mover car;
      car.way = lane;
      const double speed_mps = random_.Uniform(6.0, 11.0);
      car.position_m = [=](double time_s) { return position + speed_mps * time_s; };
      car.body = BuildCar({0.0, 0.0}, {0.0, 1.0}, random_.Next(), builder_);
      world_.movers.push_back(std::move(car));
    }
  }

  struct House {
    Eigen::Vector2d middle;
    double inner, outer;  // radii
  };

  const StreetPlan& plan_;
  uint32_t seed_;
  World& world_;
  WorldBuilder builder_;
  Random random_;
  StreetMap drive_;
  std::vector<House> houses_;
};

}  // namespace

World BuildStreets(const StreetPlan& plan, uint32_t seed) {
  World world;
  world.streets = std::make_shared<const StreetMap>(plan.streets);
  StreetBuilder(plan, seed, world).Build();
  return world;
}

}  // namespace tessera
