#include "simulation/country.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "simulation/drive.h"
#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kLapM = 4000.0;
constexpr double kOverlapM = 150.0;
constexpr double kStepM = 0.25;
constexpr double kLaneM = 1.6;
constexpr int kNumControls = 20;
constexpr int kNumBends = 7;       // open stretches in the sharpest bends
constexpr int kNumStraights = 2;   // and elsewhere
constexpr double kStartM = 200.0;  // no open stretch is nearer to where the lap closes
constexpr double kBetweenM = 70.0;

// Corners of a closed line around the origin, at uneven distances from it.
std::array<Eigen::Vector2d, kNumControls> DrawControls(uint32_t seed) {
  Random random(HashOf(seed, 61));
  std::array<Eigen::Vector2d, kNumControls> controls;
  for (size_t i = 0; i < controls.size(); ++i) {
    constexpr size_t kPerQuarter = kNumControls / 4;
    const double part = (static_cast<double>(i % kPerQuarter) + random.Uniform(0.1, 0.9)) / kPerQuarter;
    const Eigen::Vector2d out = OnCircle(i / kPerQuarter, part);
    controls[i] = random.Uniform(0.75, 1.25) * out;
  }
  return controls;
}

// A closed uniform cubic B-spline (its curvature has no jumps), scaled to this length.
Polyline DrawRoad(uint32_t seed, double length_m) {
  const auto controls = DrawControls(seed);
  constexpr int kNumSamples = 1000;
  Polyline line;
  for (size_t i = 0; i < controls.size(); ++i) {
    const auto at = [&](size_t k) -> const Eigen::Vector2d& { return controls[(i + k) % controls.size()]; };
    for (int k = 0; k < kNumSamples; ++k) {
      const double t = static_cast<double>(k) / kNumSamples;
      const double u = 1.0 - t;
      line.push_back((u * u * u * at(0) + (3.0 * t * t * t - 6.0 * t * t + 4.0) * at(1) +
                      (3.0 * u * u * u - 6.0 * u * u + 4.0) * at(2) + t * t * t * at(3)) /
                     6.0);
    }
  }
  line.push_back(line.front());
  const double scale = length_m / LengthOf(line);
  for (Eigen::Vector2d& p : line) p *= scale;
  Polyline road = Resample(line, kStepM);
  road.push_back(line.back());
  return road;
}

// Mean curvature over 60 m around each post, 1/m; posts every 5 m.
std::vector<double> CurvatureOf(const Polyline& road) {
  const auto num = static_cast<ptrdiff_t>(road.size()) - 1;
  const auto at = [&](ptrdiff_t i) { return road[static_cast<size_t>((i + num) % num)]; };
  constexpr ptrdiff_t kReach = 120;
  std::vector<double> curvature;
  for (ptrdiff_t i = 0; i < num; i += 20) {
    const double reach_m = kReach * kStepM;
    curvature.push_back((at(i - kReach) - 2.0 * at(i) + at(i + kReach)).norm() / (reach_m * reach_m));
  }
  return curvature;
}

// Open stretches: posts with the largest value first, as long as they keep apart.
void AddOpen(const std::vector<double>& value, size_t num, Random& random, std::vector<Stretch>& open) {
  std::vector<size_t> posts(value.size());
  std::iota(posts.begin(), posts.end(), size_t{0});
  std::sort(posts.begin(), posts.end(), [&](size_t a, size_t b) { return value[a] > value[b]; });
  const size_t wanted = open.size() + num;
  for (const size_t post : posts) {
    if (open.size() == wanted) return;
    const double half = 0.5 * random.Uniform(20.0, 130.0);
    const double middle = 5.0 * static_cast<double>(post);
    const Stretch stretch{Stretch::Kind::kOpen, middle - half, middle + half};
    const bool is_apart = std::none_of(open.begin(), open.end(), [&](const Stretch& other) {
      return stretch.from_m < other.to_m + kBetweenM && other.from_m < stretch.to_m + kBetweenM;
    });
    if (is_apart && stretch.from_m > kStartM && stretch.to_m < kLapM - kStartM) open.push_back(stretch);
  }
}

std::vector<Stretch> DrawStretches(const Polyline& road, uint32_t seed) {
  Random random(HashOf(seed, 62));
  std::vector<Stretch> open;
  std::vector<double> curvature = CurvatureOf(road);
  AddOpen(curvature, kNumBends, random, open);
  for (double& value : curvature) value = random.Uniform(0.0, 1.0);
  AddOpen(curvature, kNumStraights, random, open);
  std::sort(open.begin(), open.end(), [](const Stretch& a, const Stretch& b) { return a.from_m < b.from_m; });
  open.push_back({Stretch::Kind::kOpen, kLapM, kLapM});
  std::vector<Stretch> stretches;
  double position = 0.0;
  for (const Stretch& next : open) {
    while (position < next.from_m) {
      const auto kind = static_cast<Stretch::Kind>(1 + random.Index(3));
      const double length = random.Uniform(120.0, 350.0);
      const double to = next.from_m - position < length + 60.0 ? next.from_m : position + length;
      stretches.push_back({kind, position, to});
      position = to;
    }
    if (next.to_m > next.from_m) stretches.push_back(next);
    position = next.to_m;
  }
  return stretches;
}

}  // namespace

CountryPlan PlanCountry(uint32_t seed, double length_m) {
  CountryPlan plan;
  plan.road = DrawRoad(seed, kLapM);
  plan.stretches = DrawStretches(plan.road, seed);
  Polyline way = plan.road;
  way.pop_back();
  const auto overlap = static_cast<ptrdiff_t>(kOverlapM / kStepM);
  way.insert(way.end(), plan.road.begin(), plan.road.begin() + overlap);
  plan.drive = Shorten(Shift(way, kLaneM), length_m);
  return plan;
}

}  // namespace tessera
