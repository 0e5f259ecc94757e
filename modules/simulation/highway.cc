#include "simulation/highway.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kRoadM = 3000.0;
constexpr double kBeyondM = 900.0;  // of road before and behind the drive: others come from there
constexpr double kStepM = 0.25;

// The tangent turns by the curvature at each step.
Polyline DrawMiddle(uint32_t seed) {
  constexpr double kSharpest = 1.0 / 900.0, kPeriodM = 400.0;
  Polyline line{{0.0, 0.0}};
  Eigen::Vector2d ahead(0.0, 1.0);
  for (double along = 0.0; along < kRoadM + 2.0 * kBeyondM; along += kStepM) {
    const double curvature = kSharpest * SmoothNoise(HashOf(seed, 31), along / kPeriodM);
    ahead = (ahead + kStepM * curvature * RightOf(ahead)).normalized();
    line.push_back(line.back() + kStepM * ahead);
  }
  return line;
}

std::vector<Overtaking> DrawOvertakings(uint32_t seed, double length_m) {
  Random random(HashOf(seed, 32));
  std::vector<Overtaking> overtakings;
  for (double begin = 0.0; begin < length_m;) {
    const double changes = begin + random.Uniform(350.0, 550.0);
    const double returns = changes + random.Uniform(450.0, 600.0);
    overtakings.push_back({begin, changes, returns});
    begin = returns + kLaneChangeM;
  }
  return overtakings;
}

}  // namespace

HighwayPlan PlanHighway(uint32_t seed, double length_m) {
  HighwayPlan plan;
  plan.middle = DrawMiddle(seed);
  plan.overtakings = DrawOvertakings(seed, kRoadM);
  const auto index_of = [](double along_m) { return static_cast<ptrdiff_t>(along_m / kStepM); };
  const Polyline driven(plan.middle.begin() + index_of(kBeyondM), plan.middle.begin() + index_of(kBeyondM + kRoadM));
  const Polyline left = Shift(driven, kLeftLaneM), right = Shift(driven, kRightLaneM);
  for (size_t i = 0; i < driven.size(); ++i) {
    const double along = kStepM * static_cast<double>(i);
    double to_left = 0.0;
    for (const Overtaking& overtaking : plan.overtakings) {
      to_left +=
          Ease((along - overtaking.changes_m) / kLaneChangeM) - Ease((along - overtaking.returns_m) / kLaneChangeM);
    }
    plan.drive.push_back(right[i] + to_left * (left[i] - right[i]));
  }
  plan.drive = Shorten(std::move(plan.drive), length_m);
  return plan;
}

namespace {

class TrafficBuilder {
 public:
  TrafficBuilder(const HighwayPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed,
                 World& world)
      : plan_(plan), drive_(drive), world_(world), builder_(world), random_(HashOf(seed, 33)) {}

  void Build() {
    for (const Overtaking& overtaking : plan_.overtakings) {
      SendLorries(overtaking);
      SendPassingCars(overtaking);
    }
    SendOncoming(kLeftLaneM, 60.0, 240.0, 29.0, 37.0, 0.05);
    SendOncoming(kRightLaneM, 50.0, 200.0, 22.0, 26.0, 0.6);
  }

 private:
  // Along the lane; it begins kBeyondM before the drive.
  Polyline Lane(double right_m) const { return Resample(Shift(plan_.middle, right_m), kMoverStepM); }

  void Send(Polyline lane, std::function<double(double)> position_m, bool is_lorry) {
    Mover car;
    car.way = std::move(lane);
    car.position_m = std::move(position_m);
    car.body = is_lorry ? BuildLorry(random_.Uniform(9.0, 16.0), random_, builder_)
                        : BuildCar({0.0, 0.0}, {0.0, 1.0}, random_.Next(), builder_);
    car.gap_m = 0.0;
    world_.movers.push_back(std::move(car));
  }

  // So far ahead of the camera when that has come `at_m` far.
  void SendAhead(double lane_m, const std::function<double(double)>& ahead_m, bool is_lorry) {
    const auto position_m = [drive = drive_, ahead_m](double time_s) {
      const double at_m = drive->DistanceAt(std::min(time_s, drive->duration_s()));
      return kBeyondM + at_m + ahead_m(at_m);
    };
    Send(Lane(lane_m), position_m, is_lorry);
  }

  // The camera catches up with them, follows at their speed, and passes them on the left lane.
  void SendLorries(const Overtaking& overtaking) {
    constexpr double kCatchingUp = 0.15, kPassing = 0.2;  // of the camera's speed
    double ahead = random_.Uniform(22.0, 35.0);
    const double reached_m = overtaking.begin_m + random_.Uniform(50.0, 250.0);
    const double passes_m = overtaking.changes_m + 0.5 * kLaneChangeM;
    const int num = 2 + random_.Index(2);
    for (int i = 0; i < num; ++i) {
      const auto ahead_m = [=](double at_m) {
        return ahead + kCatchingUp * std::max(0.0, reached_m - at_m) - kPassing * std::max(0.0, at_m - passes_m);
      };
      SendAhead(kRightLaneM, ahead_m, i == 0 || random_.Chance(0.7));
      ahead += random_.Uniform(30.0, 45.0);
    }
  }

  void SendPassingCars(const Overtaking& overtaking) {
    for (double at = overtaking.begin_m + random_.Uniform(40.0, 150.0); at < overtaking.changes_m - 120.0;
         at += random_.Uniform(100.0, 250.0)) {
      const double faster = random_.Uniform(0.12, 0.3);
      SendAhead(kLeftLaneM, [=](double at_m) { return faster * (at_m - at); }, false);
    }
  }

  void SendOncoming(double lane_m, double min_gap_m, double max_gap_m, double min_mps, double max_mps, double lorries) {
    Polyline lane = Lane(-lane_m);
    std::reverse(lane.begin(), lane.end());
    // Those that the camera meets until the end started farther away than the road is long: there are none beyond.
    const double mps = random_.Uniform(min_mps, max_mps);
    const double begin_m = -mps * drive_->duration_s();
    for (double start = begin_m; start < LengthOf(lane); start += random_.Uniform(min_gap_m, max_gap_m)) {
      Send(lane, [=](double time_s) { return start + mps * time_s; }, random_.Chance(lorries));
    }
  }

  const HighwayPlan& plan_;
  std::shared_ptr<const CarTrajectory> drive_;
  World& world_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

void AddHighwayTraffic(const HighwayPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed,
                       World& world) {
  TrafficBuilder(plan, drive, seed, world).Build();
}

}  // namespace tessera
