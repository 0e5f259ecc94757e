#include "simulation/drive.h"

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
constexpr double kCruiseMps = 8.0;
constexpr double kLaneM = 1.75;    // from the street's middle to the middle of the right lane
constexpr double kCornerM = 14.0;  // where a bend at a crossing begins
constexpr double kCameraHeightM = 1.65;
constexpr double kSideAccelerationMps2 = 2.2;
constexpr double kAccelerationMps2 = 1.6;

using Crossing = std::array<int, 2>;  // column, row of the grid of streets

// A wave like a sine of period 1, of parabolas: exact arithmetic, the same on every machine.
double Wave(double x) {
  const double t = x - std::floor(x);
  return t < 0.5 ? 16.0 * t * (0.5 - t) : -16.0 * (t - 0.5) * (1.0 - t);
}

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

// The polyline with its corners cut by parabolas.
Polyline RoundCorners(const Polyline& line) {
  Polyline smooth{line.front()};
  for (size_t i = 1; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d in = line[i] - line[i - 1];
    const Eigen::Vector2d out = line[i + 1] - line[i];
    const double reach = std::min({kCornerM, 0.45 * in.norm(), 0.45 * out.norm()});
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

// The line shifted to its right.
Polyline Shift(const Polyline& line, double right_m) {
  Polyline shifted;
  for (size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d along = line[std::min(i + 1, line.size() - 1)] - line[i > 0 ? i - 1 : 0];
    shifted.push_back(line[i] + right_m * RightOf(along.normalized()));
  }
  return shifted;
}

Polyline Shorten(Polyline line, double length_m) {
  if (length_m <= 0.0) return line;
  double length = 0.0;
  for (size_t i = 1; i < line.size(); ++i) {
    length += (line[i] - line[i - 1]).norm();
    if (length >= length_m) {
      line.resize(i + 1);
      break;
    }
  }
  return line;
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
  for (const Eigen::Vector2d& p : Resample(RoundCorners(corners), 1.0)) middle.push_back(Bend(p, seed));
  plan.drive = Shorten(Shift(Resample(middle, kStepM), kLaneM), length_m);
  return plan;
}

}  // namespace

StreetPlan PlanTown(uint32_t seed, double length_m) {
  return PlanWalk({{0, 0}, {0, 1}, {0, 2}, {1, 2}, {1, 1}, {2, 1}, {2, 2}, {3, 2}, {3, 3}, {2, 3},
                   {1, 3}, {1, 2}, {0, 2}, {0, 1}, {1, 1}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {4, 1},
                   {3, 1}, {3, 2}, {2, 2}, {2, 1}, {2, 0}, {1, 0}, {0, 0}, {0, 1}, {0, 2}, {1, 2}},
                  seed, length_m);
}

StreetPlan PlanRound(uint32_t seed, double length_m) {
  StreetPlan plan = PlanWalk({{0, 0}, {0, 1}, {1, 1}, {1, 0}, {0, 0}, {0, 1}}, seed, length_m);
  // The round, and about 40 m of it again.
  const Polyline round = {CrossingPoint({0, 0}, seed), CrossingPoint({0, 1}, seed), CrossingPoint({1, 1}, seed),
                          CrossingPoint({1, 0}, seed), CrossingPoint({0, 0}, seed)};
  plan.drive = Shorten(std::move(plan.drive), LengthOf(round) + 40.0);
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
  StreetPlan plan;
  plan.drive = Shorten(Resample(way, kStepM), length_m);
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

Rigid3 LookAlong(const Eigen::Vector3d& position, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = forward.normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3::FromMatrix(rotation, position);
}

CarTrajectory::CarTrajectory(const Polyline& drive, double speed, uint32_t seed)
    : points_(Resample(drive, kStepM)), seed_(seed) {
  const auto at = [&](ptrdiff_t i) {
    return points_[static_cast<size_t>(std::clamp<ptrdiff_t>(i, 0, static_cast<ptrdiff_t>(points_.size()) - 1))];
  };
  std::vector<double> speeds(points_.size());
  for (size_t i = 0; i < points_.size(); ++i) {
    // Curvature over 3 m: |second difference| / step^2.
    const auto k = static_cast<ptrdiff_t>(i);
    const double curvature = (at(k - 12) - 2.0 * at(k) + at(k + 12)).norm() / (9.0);
    speeds[i] = std::min(kCruiseMps, std::sqrt(kSideAccelerationMps2 / std::max(curvature, 1e-4)));
  }
  // v^2 = u^2 + 2 a s, forwards and backwards.
  const double gain = 2.0 * kAccelerationMps2 * kStepM;
  for (size_t i = 1; i < speeds.size(); ++i) {
    speeds[i] = std::min(speeds[i], std::sqrt(speeds[i - 1] * speeds[i - 1] + gain));
  }
  for (size_t i = speeds.size() - 1; i > 0; --i) {
    speeds[i - 1] = std::min(speeds[i - 1], std::sqrt(speeds[i] * speeds[i] + gain));
  }
  times_s_.push_back(0.0);
  for (size_t i = 1; i < points_.size(); ++i) {
    times_s_.push_back(times_s_.back() + 2.0 * kStepM / (speed * (speeds[i - 1] + speeds[i])));
  }
}

double CarTrajectory::duration_s() const { return times_s_.back(); }

double CarTrajectory::DistanceAt(double time_s) const {
  const auto after = std::upper_bound(times_s_.begin() + 1, times_s_.end() - 1, time_s);
  const auto i = static_cast<size_t>(after - times_s_.begin());
  return kStepM * (static_cast<double>(i - 1) + (time_s - times_s_[i - 1]) / (times_s_[i] - times_s_[i - 1]));
}

Eigen::Vector2d CarTrajectory::PointAt(double distance_m) const {
  const double last = static_cast<double>(points_.size() - 1);
  const double position = std::clamp(distance_m / kStepM, 0.0, last - 1e-6);
  const auto i = static_cast<size_t>(position);
  return points_[i] + (position - static_cast<double>(i)) * (points_[i + 1] - points_[i]);
}

Eigen::Vector2d CarTrajectory::PositionAt(double time_s) const { return PointAt(DistanceAt(time_s)); }

Eigen::Vector2d CarTrajectory::DirectionAt(double time_s) const {
  // Over the length of a car, which no corner of the line disturbs.
  const double distance = DistanceAt(time_s);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const double reach : {0.7, 1.4, 2.1}) {
    sum += (PointAt(distance + reach) - PointAt(distance - reach)).normalized();
  }
  return sum.normalized();
}

Rigid3 CarTrajectory::WorldFromCamera(double time_s) const {
  const Eigen::Vector2d position = PositionAt(time_s);
  const Eigen::Vector2d direction = DirectionAt(time_s);
  const auto sway = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed_, axis), hertz * time_s); };
  const double heave = 0.012 * sway(1, 3.0);
  const Rigid3 level =
      LookAlong({position.x(), -kCameraHeightM + heave, position.y()}, {direction.x(), 0.0, direction.y()});
  // Small angles as half-angle quaternions: no trigonometry, exact arithmetic.
  const double pitch = 0.006 * sway(2, 2.1) + 0.003 * sway(3, 5.0);
  const double roll = 0.005 * sway(4, 1.7);
  const double yaw = 0.003 * sway(5, 1.1);
  const Eigen::Quaterniond nod = Eigen::Quaterniond(1.0, 0.5 * pitch, 0.5 * yaw, 0.5 * roll).normalized();
  return {(level.rotation * nod).normalized(), level.translation};
}

HandTrajectory::HandTrajectory(const Eigen::Vector3d& room_m, double duration_s, double speed, uint32_t seed)
    : room_m_(room_m), duration_s_(duration_s), speed_(speed), seed_(seed) {}

Rigid3 HandTrajectory::WorldFromCamera(double time_s) const {
  const double round = speed_ * time_s / 20.0;  // one round takes 20 s
  const double shift = static_cast<double>(UnitOf(HashOf(seed_, 1)));
  const auto tremor = [&](uint32_t axis) {
    return 0.012 * SmoothNoise(HashOf(seed_, axis), 1.3 * time_s) +
           0.003 * SmoothNoise(HashOf(seed_, axis, 1), 5.0 * time_s);
  };
  const Eigen::Vector3d position(0.2 * room_m_.x() * Wave(round + shift) + tremor(2),
                                 -1.45 + 0.15 * Wave(2.0 * round) + tremor(3),
                                 0.2 * room_m_.z() * Wave(round + shift + 0.25) + tremor(4));
  // Looks at a position that goes along the walls.
  const double gaze = round + shift + 0.04 * Wave(3.0 * round);
  const Eigen::Vector3d target(0.5 * room_m_.x() * Wave(gaze + 0.06), -1.1 + 0.35 * Wave(2.0 * round + 0.3),
                               0.5 * room_m_.z() * Wave(gaze + 0.31));
  const Rigid3 level = LookAlong(position, target - position);
  const Eigen::Quaterniond shake =
      Eigen::Quaterniond(1.0, tremor(5), tremor(6), 0.05 * Wave(1.5 * round) + tremor(7)).normalized();
  return {(level.rotation * shake).normalized(), position};
}

}  // namespace tessera
