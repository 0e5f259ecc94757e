#include "simulation/street_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include "core/errors.h"
#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kStepM = 0.25;
// Of a drive along given poses: every KITTI sequence is much shorter, and streets are built all along.
constexpr double kMaxDriveM = 50'000.0;
constexpr double kLaneM = 1.75;    // from the street's middle to the middle of the right lane
constexpr double kCornerM = 14.0;  // where a bend at a crossing begins

using Crossing = std::array<int, 2>;  // column, row of the grid of streets

// Bends the plane, so that streets are not straight.
Eigen::Vector2d Bend(const Eigen::Vector2d& p, uint32_t seed) {
  const double shift = static_cast<double>(UnitOf(HashOf(seed, 1)));
  return {p.x() + 9.0 * Wave(p.y() / 310.0 + shift) + 3.0 * Wave(p.y() / 120.0),
          p.y() + 8.0 * Wave(p.x() / 270.0 - shift) + 3.0 * Wave(p.x() / 140.0)};
}

Eigen::Vector2d CrossingPoint(const Crossing& crossing, uint32_t seed) {
  constexpr std::array<double, 5> kColumns{0.0, 96.0, 168.0, 282.0, 366.0};
  constexpr std::array<double, 4> kRows{0.0, 84.0, 190.0, 268.0};
  Random random(HashOf(seed, static_cast<uint32_t>(crossing[0]), static_cast<uint32_t>(crossing[1])));
  const double dx = random.Uniform(-6.0, 6.0);
  const double dy = random.Uniform(-6.0, 6.0);
  return {kColumns[static_cast<size_t>(crossing[0])] + dx, kRows[static_cast<size_t>(crossing[1])] + dy};
}

// The polyline with its corners cut by parabolas, from this far before to this far behind each.
Polyline RoundCorners(const Polyline& line, double corner_m) {
  Polyline smooth{line.front()};
  for (size_t i = 1; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d in = line[i] - line[i - 1];
    const Eigen::Vector2d out = line[i + 1] - line[i];
    const double reach = std::min({corner_m, 0.45 * in.norm(), 0.45 * out.norm()});
    const Eigen::Vector2d from = line[i] - reach * in.normalized();
    const Eigen::Vector2d to = line[i] + reach * out.normalized();
    for (int k = 0; k <= 16; ++k) {
      const double t = k / 16.0;
      smooth.push_back((1 - t) * (1 - t) * from + 2 * t * (1 - t) * line[i] + t * t * to);
    }
  }
  smooth.push_back(line.back());
  return smooth;
}

// The way's first `length_m`; 0: all of it. Throws InputError if it is shorter.
Polyline Begin(Polyline way, double length_m) {
  if (length_m > LengthOf(way) + 1.0) {
    throw InputError("sim: the way through this world is " + std::to_string(static_cast<int>(LengthOf(way))) +
                     " m long: give a length of at most that");
  }
  return Shorten(std::move(way), length_m);
}

StreetPlan PlanWalk(const std::vector<Crossing>& walk, uint32_t seed, double length_m) {
  StreetPlan plan;
  Polyline corners;
  std::set<std::pair<Crossing, Crossing>> built;
  for (size_t i = 0; i < walk.size(); ++i) {
    corners.push_back(CrossingPoint(walk[i], seed));
    if (i > 0 && built.insert(std::minmax(walk[i - 1], walk[i])).second) {
      Polyline street;
      for (const Eigen::Vector2d& p : Resample({corners[i - 1], corners[i]}, 2.0)) street.push_back(Bend(p, seed));
      plan.streets.push_back(std::move(street));
    }
  }
  Polyline middle;
  for (const Eigen::Vector2d& p : Resample(RoundCorners(corners, kCornerM), 1.0)) middle.push_back(Bend(p, seed));
  plan.drive = Shorten(Shift(Resample(middle, kStepM), kLaneM), length_m);
  return plan;
}

// Corners of a way beside the streets from crossing to crossing: on the right pavement, on the road twice a street.
Polyline CornersOfStroll(const std::vector<Crossing>& walk, uint32_t seed) {
  constexpr double kPavementM = 6.9;
  const auto leg = [&](size_t i) { return (CrossingPoint(walk[i + 1], seed) - CrossingPoint(walk[i], seed)).eval(); };
  Polyline corners;
  for (size_t i = 0; i < walk.size(); ++i) {
    const Eigen::Vector2d before = RightOf(leg(i > 0 ? i - 1 : 0).normalized());
    const Eigen::Vector2d behind = RightOf(leg(std::min(i, walk.size() - 2)).normalized());
    // Where the two shifted lines meet.
    corners.push_back(CrossingPoint(walk[i], seed) + kPavementM * (before + behind) / (1.0 + before.dot(behind)));
    if (i + 1 == walk.size()) break;
    // The same ways in the same street: it depends on where it begins.
    Random random(HashOf(seed, 41, static_cast<uint32_t>(walk[i][0]), static_cast<uint32_t>(walk[i][1])));
    const Eigen::Vector2d along = leg(i).normalized();
    const double length = leg(i).norm();
    const Eigen::Vector2d start = CrossingPoint(walk[i], seed);
    for (const double part : {0.22, 0.58}) {
      const double out_m = random.Uniform(part, part + 0.06) * length;
      const double back_m = out_m + random.Uniform(10.0, 16.0);
      const double right_m = random.Uniform(0.0, 3.0);
      const double slant_m = random.Uniform(3.5, 6.0);
      for (const Eigen::Vector2d& p :
           {Eigen::Vector2d(out_m, kPavementM), Eigen::Vector2d(out_m + slant_m, right_m),
            Eigen::Vector2d(back_m, right_m), Eigen::Vector2d(back_m + slant_m, kPavementM)}) {
        corners.push_back(start + p.x() * along + p.y() * RightOf(along));
      }
    }
  }
  return corners;
}

}  // namespace

// Of a longer drive: the same round again, which ends with the streets with which it begins.
StreetPlan PlanTown(uint32_t seed, double length_m) {
  constexpr size_t kNumCommon = 4;
  const std::vector<Crossing> round{{0, 0}, {0, 1}, {0, 2}, {1, 2}, {1, 1}, {2, 1}, {2, 2}, {3, 2}, {3, 3}, {2, 3},
                                    {1, 3}, {1, 2}, {0, 2}, {0, 1}, {1, 1}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {4, 1},
                                    {3, 1}, {3, 2}, {2, 2}, {2, 1}, {2, 0}, {1, 0}, {0, 0}, {0, 1}, {0, 2}, {1, 2}};
  std::vector<Crossing> walk = round;
  StreetPlan plan = PlanWalk(walk, seed, length_m);
  while (LengthOf(plan.drive) < length_m) {
    walk.insert(walk.end(), round.begin() + kNumCommon, round.end());
    plan = PlanWalk(walk, seed, length_m);
  }
  return plan;
}

StreetPlan PlanRound(uint32_t seed, double length_m) {
  StreetPlan plan = PlanWalk({{0, 0}, {0, 1}, {1, 1}, {1, 0}, {0, 0}, {0, 1}}, seed, 0.0);
  // The round, and about 40 m of it again.
  const Polyline round = {CrossingPoint({0, 0}, seed), CrossingPoint({0, 1}, seed), CrossingPoint({1, 1}, seed),
                          CrossingPoint({1, 0}, seed), CrossingPoint({0, 0}, seed)};
  plan.drive = Begin(Shorten(std::move(plan.drive), LengthOf(round) + 40.0), length_m);
  return plan;
}

StreetPlan PlanTraffic(uint32_t seed, double length_m, double stop_m) {
  constexpr double kWaitS = 9.0;
  const std::vector<Crossing> walk{{1, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1}, {2, 0}, {1, 0}, {1, 1}, {1, 2}};
  StreetPlan plan = PlanWalk(walk, seed, 0.0);
  const StreetPlan across = PlanWalk({{0, 1}, {1, 1}, {2, 1}, {3, 1}}, seed, 0.0);
  plan.streets.insert(plan.streets.end(), across.streets.begin(), across.streets.end());
  Polyline crossing;
  for (const Polyline& street : across.streets) crossing.insert(crossing.end(), street.begin(), street.end());
  plan.drive = Begin(Shorten(std::move(plan.drive), LengthOf(plan.drive) - 40.0), length_m);
  const StreetMap crossings({crossing});
  double along_m = 0.0, last_m = -stop_m;
  for (size_t i = 0; i + 1 < plan.drive.size(); ++i) {
    const Eigen::Vector2d step = plan.drive[i + 1] - plan.drive[i];
    along_m += step.norm();
    const bool is_there = crossings.DistanceToStreet(plan.drive[i]) < stop_m;
    if (!is_there || along_m - last_m < 4.0 * stop_m) continue;
    last_m = along_m;
    const bool from_left = (crossing.back() - crossing.front()).dot(RightOf(step)) > 0.0;
    plan.stops.push_back({along_m, kWaitS, from_left ? crossing : Polyline(crossing.rbegin(), crossing.rend())});
  }
  return plan;
}

StreetPlan PlanStroll(uint32_t seed, double length_m) {
  const std::vector<Crossing> walk{{0, 0}, {0, 1}, {1, 1}, {1, 0}, {0, 0}, {0, 1}, {1, 1}};
  StreetPlan plan = PlanWalk(walk, seed, 0.0);
  Polyline way;
  for (const Eigen::Vector2d& p : Resample(RoundCorners(CornersOfStroll(walk, seed), 3.0), kStepM)) {
    way.push_back(Bend(p, seed));
  }
  plan.drive = Begin(std::move(way), length_m);
  plan.gap_m = 0.8;
  plan.has_traffic = false;
  return plan;
}

StreetPlan PlanFromPoses(const std::string& path, double length_m) {
  std::ifstream file(path);
  if (!file) throw InputError("poses file " + path + " can't be read");
  Polyline way;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream row(line);
    std::array<double, 12> m{};
    for (double& value : m) row >> value;
    if (!row) throw InputError(path + " line " + std::to_string(number) + ": twelve numbers are wanted, a 3x4 matrix");
    const Eigen::Vector2d p(m[3], m[11]);
    if (way.empty() || (p - way.back()).norm() > 0.1) way.push_back(p);
  }
  if (way.size() < 2) throw InputError(path + " holds no drive: fewer than two positions");
  if (!(LengthOf(way) <= kMaxDriveM)) throw InputError(path + " holds a drive of more than 50 km");
  StreetPlan plan;
  plan.drive = Begin(Resample(way, kStepM), length_m);
  // A street is built where the drive comes for the first time.
  Polyline street;
  const Polyline posts = Resample(plan.drive, 4.0);
  for (size_t i = 0; i < posts.size(); ++i) {
    const bool is_known = std::any_of(posts.begin(), posts.begin() + static_cast<ptrdiff_t>(i), [&](const auto& post) {
      return static_cast<size_t>(&post - posts.data()) + 10 < i && (post - posts[i]).squaredNorm() < 36.0;
    });
    if (!is_known) street.push_back(posts[i]);
    if ((is_known || i + 1 == posts.size()) && !street.empty()) {
      if (street.size() > 1) plan.streets.push_back(street);
      street.clear();
    }
  }
  return plan;
}

}  // namespace tessera
