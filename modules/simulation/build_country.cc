// A landscape along a road: hills as a net of triangles, what stands beside the road, ridges all around, clouds.
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "simulation/country.h"
#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kCellM = 12.0;     // of the net
constexpr double kBeyondM = 450.0;  // from the lap to the end of the net, where the nearest ridge stands
constexpr double kRoadsideM = 5.2;  // nothing stands nearer to the road's middle
constexpr int kNumTreeKinds = 5;
constexpr double kOpenRoughness = 0.4;  // of the road in open stretches; elsewhere 1

class CountryBuilder {
 public:
  CountryBuilder(const CountryPlan& plan, const Terrain& terrain, uint32_t seed, World& world)
      : plan_(plan), terrain_(terrain), seed_(seed), builder_(world), random_(HashOf(seed, 71)), line_(plan.road) {
    for (const Eigen::Vector2d& p : plan.road) middle_ += p / static_cast<double>(plan.road.size());
    for (const Eigen::Vector2d& p : plan.road) reach_ = std::max(reach_, (p - middle_).norm());
    for (const Stretch& stretch : plan.stretches) {
      if (stretch.kind != Stretch::Kind::kOpen) continue;
      for (double along = stretch.from_m; along < stretch.to_m + 8.0; along += 8.0) {
        open_.push_back(line_.At(std::min(along, stretch.to_m)));
      }
    }
    for (int i = 0; i < kNumTreeKinds; ++i) {
      const double crown = random_.Uniform(3.5, 6.5);
      const double trunk = random_.Uniform(1.2, 2.8);
      trees_.push_back(MakeTreeKind(crown, trunk, 0.03 * crown, random_, builder_));
    }
  }

  void Build() {
    BuildGround();
    for (const Stretch& stretch : plan_.stretches) {
      switch (stretch.kind) {
        case Stretch::Kind::kOpen:
          break;
        case Stretch::Kind::kForest:
          PlantForest(stretch);
          break;
        case Stretch::Kind::kAvenue:
          PlantAvenue(stretch);
          break;
        case Stretch::Kind::kHedges:
          BuildHedges(stretch);
          break;
      }
    }
    AddRidges(middle_, reach_ + kBeyondM, random_, builder_);
    AddClouds(middle_, HashOf(seed_, 6), builder_);
  }

 private:
  bool IsFree(const Eigen::Vector2d& p, double gap_m) const {
    return terrain_.road().DistanceToStreet(p) >= kRoadsideM + gap_m && !IsOpen(p, kOpenM);
  }
  // Whether an open stretch is so near.
  bool IsOpen(const Eigen::Vector2d& p, double distance_m) const {
    return std::any_of(open_.begin(), open_.end(), [&](const auto& post) { return (post - p).norm() < distance_m; });
  }
  // A little in the ground, since the net of triangles and the terrain differ.
  double FootOf(const Eigen::Vector2d& p) const { return terrain_.HeightAt(p) - 0.25; }

  void Plant(const TreeKind& kind, const Eigen::Vector2d& foot) {
    if (IsFree(foot, 0.3)) PlantTree(kind, foot, FootOf(foot), builder_);
  }

  void PlantForest(const Stretch& stretch) {
    for (double along = stretch.from_m; along < stretch.to_m; along += random_.Uniform(2.0, 4.5)) {
      for (const double side : {1.0, -1.0}) {
        const double reach_m = 30.0 * random_.Uniform(0.0, 1.0);
        const double right = 6.5 + reach_m * random_.Uniform(0.0, 1.0);
        const auto kind = static_cast<size_t>(random_.Index(kNumTreeKinds));
        Plant(trees_[kind], line_.Beside(along, side * right));
      }
    }
  }

  void PlantAvenue(const Stretch& stretch) {
    const TreeKind& kind = trees_[static_cast<size_t>(random_.Index(kNumTreeKinds))];
    for (double along = stretch.from_m; along < stretch.to_m; along += 11.0) {
      for (const double side : {1.0, -1.0}) Plant(kind, line_.Beside(along, 6.2 * side));
    }
  }

  void BuildHedges(const Stretch& stretch) {
    for (double along = stretch.from_m + 2.0; along < stretch.to_m; along += random_.Uniform(3.0, 9.0)) {
      const double side = random_.Chance(0.5) ? 1.0 : -1.0;
      const double draw = random_.Uniform(0.0, 1.0);
      if (draw < 0.45) {
        PutHedge(along, side * random_.Uniform(6.5, 9.0));
      } else if (draw < 0.65) {
        PutPost(line_.Beside(along, 5.6 * side));
      } else if (draw < 0.93) {
        const auto kind = static_cast<size_t>(random_.Index(kNumTreeKinds));
        Plant(trees_[kind], line_.Beside(along, side * random_.Uniform(6.5, 22.0)));
      } else {
        PutBarn(line_.Beside(along, side * random_.Uniform(18.0, 30.0)), line_.AheadAt(along));
      }
    }
  }

  void PutHedge(double along_m, double right_m) {
    const double half = random_.Uniform(2.0, 5.0);
    const Eigen::Vector2d middle = line_.Beside(along_m, right_m);
    const Eigen::Vector2d ahead = line_.AheadAt(along_m);
    const bool is_hedge = random_.Chance(0.6);
    const double height = random_.Uniform(0.9, 1.9);
    const PaintSpec spec{is_hedge ? Material::kHedge : Material::kFence, random_.Next(), 2.0 * half, height, 0.03};
    if (!IsFree(middle - half * ahead, 0.5) || !IsFree(middle + half * ahead, 0.5)) return;
    const double bottom = FootOf(middle) - 0.3;
    const int32_t paint = builder_.AddPaint(spec);
    const double half_width = is_hedge ? 0.4 : 0.04;
    builder_.Add(builder_.Box(middle, ahead, half, half_width, bottom, height + 0.5, paint, paint));
    builder_.Add(builder_.Lid(middle, ahead, half, half_width, bottom + height + 0.5, paint));
  }

  // A white post as it marks the edge of a road.
  void PutPost(const Eigen::Vector2d& foot) {
    if (!IsFree(foot, 0.0)) return;
    const int32_t paint = builder_.AddPaint({Material::kSign, random_.Next(), 0.14, 1.0, 0.01});
    builder_.Add(builder_.Box(foot, {1.0, 0.0}, 0.07, 0.07, FootOf(foot), 1.2, paint, paint));
  }

  void PutBarn(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead) {
    const double half_length = random_.Uniform(5.0, 9.0);
    const double half_width = random_.Uniform(3.5, 5.0);
    const double height = random_.Uniform(4.5, 7.0);
    const uint32_t style = random_.Next();
    if (!IsFree(middle, half_length + half_width)) return;
    const int32_t side = builder_.AddPaint({Material::kFacade, style, 2.0 * half_length, height, 0.03});
    const int32_t end = builder_.AddPaint({Material::kFacade, style, 2.0 * half_width, height, 0.03});
    builder_.Add(builder_.Box(middle, ahead, half_length, half_width, FootOf(middle) - 0.6, height + 0.6, side, end));
  }

  // Fields in strips; a strip has one tone.
  double ToneAt(int column, int row) const {
    const int strip = static_cast<int>(std::floor(column / 9.0));
    const auto shift = static_cast<int>(HashOf(seed_, 81, static_cast<uint32_t>(strip)) % 12);
    const int plot = static_cast<int>(std::floor((row + shift) / 13.0));
    constexpr double kTones[] = {88.0, 97.0, 104.0, 112.0, 124.0, 138.0};
    return kTones[HashOf(seed_, 82, static_cast<uint32_t>(strip), static_cast<uint32_t>(plot)) % 6];
  }

  int32_t GroundPaint(int column, int row) {
    const double tone = ToneAt(column, row);
    const Eigen::Vector2d corner = kCellM * Eigen::Vector2d(column, row);
    const Eigen::Vector2d center = corner + Eigen::Vector2d::Constant(0.5 * kCellM);
    if (terrain_.road().DistanceToStreet(center) < 16.0) {
      const double roughness = IsOpen(center, 25.0) ? kOpenRoughness : 1.0;
      return builder_.AddPaint(
          {Material::kCountryRoad, HashOf(seed_, 83), kCellM, kCellM, 0.025, corner, tone, roughness});
    }
    // Cells of one tone share sixteen paints: grain repeats every 512 texels.
    const auto [paint, is_new] = fields_.try_emplace({tone, column & 3, row & 3}, 0);
    if (is_new) {
      const Eigen::Vector2d origin = kCellM * Eigen::Vector2d(column & 3, row & 3);
      paint->second =
          builder_.AddPaint({Material::kField, HashOf(seed_, 84), kCellM, kCellM, kCellM / 128.0, origin, tone});
    }
    return paint->second;
  }

  void BuildGround() {
    const auto first = [&](double x) { return static_cast<int>(std::floor((x - reach_ - kBeyondM) / kCellM)); };
    const auto last = [&](double x) { return static_cast<int>(std::floor((x + reach_ + kBeyondM) / kCellM)); };
    for (int row = first(middle_.y()); row <= last(middle_.y()); ++row) {
      for (int column = first(middle_.x()); column <= last(middle_.x()); ++column) {
        const Eigen::Vector2d center = kCellM * Eigen::Vector2d(column + 0.5, row + 0.5);
        if ((center - middle_).norm() > reach_ + kBeyondM + kCellM) continue;
        AddCell(column, row, GroundPaint(column, row));
      }
    }
  }

  void AddCell(int column, int row, int32_t paint) {
    const auto at = [&](int i, int k) -> Eigen::Vector3d {
      const Eigen::Vector2d p = kCellM * Eigen::Vector2d(column + i, row + k);
      return {p.x(), -terrain_.HeightAt(p), p.y()};
    };
    const Eigen::Vector3d a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
    // Seen from above: z is up in the picture.
    Surface lower{a, b - a, d - a, paint};
    lower.part = SurfacePart::kLower;
    Surface upper{b + d - c, c - d, c - b, paint};
    upper.part = SurfacePart::kUpper;
    for (Surface* half : {&lower, &upper}) {
      const Eigen::Vector3d normal = half->across.cross(half->up).normalized();
      half->brightness = BrightnessOf(normal.y() < 0.0 ? normal : Eigen::Vector3d(-normal));
      builder_.Add(*half);
    }
  }

  const CountryPlan& plan_;
  const Terrain& terrain_;
  uint32_t seed_;
  WorldBuilder builder_;
  Random random_;
  MeterLine line_;  // the road's middle
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double reach_ = 0.0;  // from the middle to the farthest point of the road
  Polyline open_;       // of open stretches, every 8 m
  std::vector<TreeKind> trees_;
  std::map<std::tuple<double, int, int>, int32_t> fields_;  // by tone and phase
};

}  // namespace

World BuildCountry(const CountryPlan& plan, const Terrain& terrain, uint32_t seed) {
  World world;
  world.streets = std::make_shared<const StreetMap>(terrain.road());
  world.sight_m = 5000.0;
  CountryBuilder(plan, terrain, seed, world).Build();
  return world;
}

}  // namespace tessera
