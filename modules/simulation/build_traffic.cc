// Vehicles that take much of the image, and move.
#include <algorithm>

#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

constexpr double kLaneM = 0.5 * kRoadHalfWidthM;  // from the street's middle

class TrafficBuilder {
 public:
  TrafficBuilder(const StreetPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed, World& world)
      : plan_(plan), drive_(drive), world_(world), builder_(world), random_(HashOf(seed, 51)) {}

  void Build() {
    for (size_t i = 0; i < plan_.stops.size(); ++i) {
      const Stop& stop = plan_.stops[i];
      const Polyline from_left = stop.crossing, from_right(from_left.rbegin(), from_left.rend());
      Cross(from_left, stop, drive_->wait_times_s()[i]);
      Cross(from_right, stop, drive_->wait_times_s()[i]);
    }
    Lead();
  }

 private:
  // One behind the other on the right lane, until the wait is over.
  void Cross(const Polyline& middle, const Stop& stop, double begin_s) {
    const Polyline lane = Resample(Shift(Resample(middle, kMoverStepM), kLaneM), kMoverStepM);
    const Eigen::Vector2d eye = Shorten(plan_.drive, stop.at_m).back();
    const auto nearest = std::min_element(lane.begin(), lane.end(), [&](const auto& a, const auto& b) {
      return (a - eye).squaredNorm() < (b - eye).squaredNorm();
    });
    const double passes_m = kMoverStepM * static_cast<double>(nearest - lane.begin());
    const double speed_mps = random_.Uniform(3.5, 6.0);
    for (double passes_s = begin_s + random_.Uniform(0.0, 2.0); passes_s < begin_s + stop.wait_s - 1.5;
         passes_s += random_.Uniform(14.0, 22.0) / speed_mps) {
      Mover car;
      car.way = lane;
      car.position_m = [=](double time_s) { return passes_m + speed_mps * (time_s - passes_s); };
      car.body = random_.Chance(0.6) ? BuildLorry(random_.Uniform(6.0, 12.0), random_, builder_)
                                     : BuildCar(kOrigin, kAhead, random_.Next(), builder_);
      world_.movers.push_back(std::move(car));
    }
  }

  // As far ahead as the camera's car gets in a second and a half, and half its own length and 7 m more.
  void Lead() {
    constexpr double kLengthM = 8.0, kGapM = 7.0, kHeadwayS = 1.5, kComesM = 150.0, kLeavesM = 280.0;
    const double length_m = LengthOf(plan_.drive);
    const double from_m = 0.4 * length_m, to_m = 0.75 * length_m;
    Mover lorry;
    lorry.way = Resample(plan_.drive, kMoverStepM);
    lorry.position_m = [=, drive = drive_](double time_s) {
      const double there_m = drive->DistanceAt(std::min(time_s + kHeadwayS, drive->duration_s()));
      const double farther_m =
          60.0 * (1.0 - Ease((there_m - from_m) / kComesM)) + 200.0 * Ease((there_m - to_m) / kLeavesM);
      return there_m + kGapM + 0.5 * kLengthM + farther_m;
    };
    lorry.body = BuildLorry(kLengthM, random_, builder_);
    world_.movers.push_back(std::move(lorry));
  }

  inline static const Eigen::Vector2d kOrigin{0.0, 0.0}, kAhead{0.0, 1.0};

  const StreetPlan& plan_;
  std::shared_ptr<const CarTrajectory> drive_;
  World& world_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

void AddTraffic(const StreetPlan& plan, const std::shared_ptr<const CarTrajectory>& drive, uint32_t seed,
                World& world) {
  TrafficBuilder(plan, drive, seed, world).Build();
}

}  // namespace tessera
