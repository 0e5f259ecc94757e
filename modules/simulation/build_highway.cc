// What stands along a motorway.
#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/highway.h"
#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kTileM = 12.0;
constexpr double kPostsM = 4.0;  // between the posts of rails, and the length of a panel
constexpr double kRailM = 13.3;  // from the middle
constexpr double kBarrierM = 15.0;
constexpr int kNumKinds = 16;      // of beams, posts and panels
constexpr double kPanelM = 3.5;    // high
constexpr double kRidgeM = 700.0;  // from the road to the nearest ridge

class HighwayBuilder {
 public:
  HighwayBuilder(const HighwayPlan& plan, uint32_t seed, World& world)
      : seed_(seed), builder_(world), random_(HashOf(seed, 41)), line_(plan.middle) {
    for (const Eigen::Vector2d& p : line_.posts()) middle_ += p / static_cast<double>(line_.posts().size());
    for (const Eigen::Vector2d& p : line_.posts()) reach_ = std::max(reach_, (p - middle_).norm());
    for (TreeKind& kind : trees_) {
      const double crown = random_.Uniform(3.0, 6.5);
      kind = MakeTreeKind(crown, random_.Uniform(0.3, 2.5), 0.03 * crown, random_, builder_);
    }
  }

  void Build() {
    BuildGround();
    BuildRails();
    BuildDelineators();
    for (double along = 0.0; along < line_.length_m();) along = BuildRoadside(along, random_.Uniform(150.0, 500.0));
    for (double along = 250.0; along < line_.length_m(); along += random_.Uniform(300.0, 600.0)) PutSign(along);
    for (double along = 500.0; along < line_.length_m(); along += random_.Uniform(700.0, 1300.0)) BuildBridge(along);
    AddRidges(middle_, reach_ + kRidgeM, random_, builder_);
    AddClouds(middle_, HashOf(seed_, 6), builder_);
  }

 private:
  void BuildGround() {
    const StreetMap& road = *builder_.world().streets;
    Eigen::Vector2d low = line_.posts().front(), high = line_.posts().front();
    for (const Eigen::Vector2d& p : line_.posts()) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const auto first = [](double x) { return static_cast<int>(std::floor((x - 24.0) / kTileM)); };
    const auto last = [](double x) { return static_cast<int>(std::floor((x + 24.0) / kTileM)); };
    for (int row = first(low.y()); row <= last(high.y()); ++row) {
      for (int column = first(low.x()); column <= last(high.x()); ++column) {
        const Eigen::Vector2d corner(kTileM * column, kTileM * row);
        const Eigen::Vector2d center = corner + Eigen::Vector2d::Constant(0.5 * kTileM);
        if (road.DistanceToStreet(center) > StreetMap::kReachM) continue;
        const PaintSpec spec{Material::kHighway, HashOf(seed_, 5), kTileM, kTileM, 0.03, corner};
        builder_.Add(
            {{corner.x(), 0.0, corner.y()}, {kTileM, 0.0, 0.0}, {0.0, 0.0, kTileM}, builder_.AddPaint(spec), 0.95F});
      }
    }
    const double far_m = reach_ + kRidgeM + 60.0;
    const int32_t grass = builder_.AddPaint({Material::kHedge, HashOf(seed_, 4), 2.0 * far_m, 2.0 * far_m, 0.7});
    // A little deeper, so that the tiles hide it.
    builder_.world().far.push_back({{middle_.x() - far_m, 0.05, middle_.y() - far_m},
                                    {2.0 * far_m, 0.0, 0.0},
                                    {0.0, 0.0, 2.0 * far_m},
                                    grass,
                                    0.95F});
  }

  // A few kinds of beams and posts, which differ in little but dirt.
  void BuildRails() {
    std::array<int32_t, kNumKinds> beams{}, posts{};
    for (int32_t& beam : beams) beam = builder_.AddPaint({Material::kCurb, random_.Next(), kPostsM, 0.31, 0.02});
    for (int32_t& post : posts) post = builder_.AddPaint({Material::kBark, random_.Next(), 0.12, 0.75, 0.02});
    const auto any_of = [this](const auto& kinds) { return kinds[static_cast<size_t>(random_.Index(kNumKinds))]; };
    for (const double right : {-kRailM, -0.6, 0.6, kRailM}) {
      for (double along = 0.0; along + kPostsM < line_.length_m(); along += kPostsM) {
        const Eigen::Vector2d from = line_.Beside(along, right), to = line_.Beside(along + kPostsM, right);
        Surface rail = builder_.Wall(from, to, 0.44, 0.31, any_of(beams));
        rail.two_sided = true;
        builder_.Add(rail);
        const int32_t post = any_of(posts);
        builder_.Add(builder_.Box(from, line_.AheadAt(along), 0.06, 0.06, 0.0, 0.78, post, post));
      }
    }
  }

  void BuildDelineators() {
    const int32_t paint = builder_.AddPaint({Material::kSign, HashOf(seed_, 9), 0.14, 1.0, 0.01});
    for (double along = 25.0; along < line_.length_m(); along += 50.0) {
      for (const double right : {-kRailM - 0.4, kRailM + 0.4}) {
        builder_.Add(
            builder_.Box(line_.Beside(along, right), line_.AheadAt(along), 0.07, 0.07, 0.0, 1.05, paint, paint));
      }
    }
  }

  // Returns where the stretch ends.
  double BuildRoadside(double from_m, double stretch_m) {
    const double to_m = from_m + stretch_m;
    for (const double side : {-1.0, 1.0}) {
      switch (random_.Index(4)) {
        case 0:  // fields, a tree here and there
          PlantTrees(from_m, to_m, side, 60.0);
          break;
        case 1:
          BuildBarrier(from_m, std::min(to_m, line_.length_m() - kPostsM), side);
          break;
        case 2:  // a wood
          PlantTrees(from_m, to_m, side, 3.0);
          break;
        default:  // bushes
          PlantTrees(from_m, to_m, side, 12.0);
      }
    }
    return to_m;
  }

  void PlantTrees(double from_m, double to_m, double side, double spacing_m) {
    for (double along = from_m; along < to_m; along += random_.Uniform(0.4, 1.6) * spacing_m) {
      const double reach_m = 30.0 * random_.Uniform(0.0, 1.0);
      const double right = 17.5 + reach_m * random_.Uniform(0.0, 1.0);
      const TreeKind& kind = trees_[static_cast<size_t>(random_.Index(kNumTreeKinds))];
      PlantTree(kind, line_.Beside(along, side * right), -0.1, builder_);
    }
  }

  void BuildBarrier(double from_m, double to_m, double side) {
    std::array<int32_t, kNumKinds> panels{};
    for (int32_t& panel : panels) {
      panel = builder_.AddPaint({Material::kNoiseBarrier, random_.Next(), kPostsM, kPanelM, 0.02});
    }
    for (double along = from_m; along < to_m; along += kPostsM) {
      const int32_t panel = panels[static_cast<size_t>(random_.Index(kNumKinds))];
      Surface wall = builder_.Wall(line_.Beside(along, side * kBarrierM),
                                   line_.Beside(along + kPostsM, side * kBarrierM), 0.0, kPanelM, panel);
      wall.two_sided = true;
      builder_.Add(wall);
    }
  }

  // A board on two legs, toward those who come.
  void PutSign(double along_m) {
    const double side = random_.Chance(0.6) ? 1.0 : -1.0;
    const double half = random_.Uniform(1.2, 2.4), tall = random_.Uniform(2.0, 3.2);
    const Eigen::Vector2d middle = line_.Beside(along_m, side * (kHardShoulderM + 1.5 + half));
    const Eigen::Vector2d right = side * RightOf(line_.AheadAt(along_m));
    const int32_t board = builder_.AddPaint({Material::kSign, random_.Next(), 2.0 * half, tall, 0.02});
    Surface sign = builder_.Wall(middle - half * right, middle + half * right, 2.2, tall, board);
    sign.two_sided = true;
    builder_.Add(sign);
    const int32_t leg = builder_.AddPaint({Material::kBark, random_.Next(), 0.2, 2.2, 0.02});
    for (const double at : {-0.7, 0.7}) {
      builder_.Add(builder_.Box(middle + at * half * right, line_.AheadAt(along_m), 0.1, 0.1, 0.0, 2.2, leg, leg));
    }
  }

  void BuildBridge(double along_m) {
    constexpr double kHighM = 5.5, kThickM = 1.3, kHalfWidthM = 5.0, kHalfLengthM = 26.0;
    if (along_m + kHalfWidthM > line_.length_m()) return;
    const Eigen::Vector2d middle = line_.At(along_m);
    const Eigen::Vector2d across = RightOf(line_.AheadAt(along_m));
    const uint32_t seed = random_.Next();
    const auto concrete = [&](double width, double height) {
      return builder_.AddPaint({Material::kCurb, seed, width, height, 0.03});
    };
    const int32_t side = concrete(2.0 * kHalfLengthM, kThickM), end = concrete(2.0 * kHalfWidthM, kThickM);
    builder_.Add(builder_.Box(middle, across, kHalfLengthM, kHalfWidthM, kHighM, kThickM, side, end));
    Surface below = builder_.Lid(middle, across, kHalfLengthM, kHalfWidthM, kHighM,
                                 concrete(2.0 * kHalfWidthM, 2.0 * kHalfLengthM));
    below.two_sided = true;
    below.brightness = 0.4F;
    builder_.Add(below);
    const int32_t pier = concrete(1.0, kHighM);
    for (const double right : {-kBarrierM - 1.5, 0.0, kBarrierM + 1.5}) {
      builder_.Add(builder_.Box(middle + right * across, across, 0.4, 0.4, 0.0, kHighM, pier, pier));
    }
  }

  static constexpr int kNumTreeKinds = 6;

  uint32_t seed_;
  WorldBuilder builder_;
  Random random_;
  MeterLine line_;  // the road's middle
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double reach_ = 0.0;  // from there to the road's farthest point
  std::array<TreeKind, kNumTreeKinds> trees_{};
};

}  // namespace

World BuildHighway(const HighwayPlan& plan, uint32_t seed) {
  World world;
  world.streets = std::make_shared<const StreetMap>(std::vector<Polyline>{plan.middle});
  world.sight_m = 900.0;
  HighwayBuilder(plan, seed, world).Build();
  return world;
}

}  // namespace tessera
