#include "simulation/drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kStepM = 0.25;
constexpr double kCameraHeightM = 1.65;
constexpr double kFlightStandsS = 2.0;  // before it takes off

// The distance along a line, reached at this time; `times_s` of its points, which are kStepM apart.
double DistanceOn(const std::vector<double>& times_s, double time_s) {
  const auto after = std::upper_bound(times_s.begin() + 1, times_s.end() - 1, time_s);
  const auto i = static_cast<size_t>(after - times_s.begin());
  return kStepM * (static_cast<double>(i - 1) + (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]));
}

Eigen::Vector2d PointOn(const Polyline& points, double distance_m) {
  const double last = static_cast<double>(points.size() - 1);
  const double position = std::clamp(distance_m / kStepM, 0.0, last - 1e-6);
  const auto i = static_cast<size_t>(position);
  return points[i] + (position - static_cast<double>(i)) * (points[i + 1] - points[i]);
}

// How far someone looks aside who does so once in every kPeriodS: the tangent of half the angle, to the right.
double AsideAt(double time_s, uint32_t seed) {
  constexpr double kPeriodS = 2.75;
  const double number = std::floor(time_s / kPeriodS);
  Random random(HashOf(seed, 23, static_cast<uint32_t>(static_cast<int64_t>(number))));
  const double begin_s = random.Uniform(1.0, 1.2);
  const double side = random.Chance(0.5) ? 1.0 : -1.0;
  const bool is_wide = random.Chance(0.4);  // the desk leaves the image
  const double far = side * (is_wide ? random.Uniform(0.42, 0.52) : random.Uniform(0.24, 0.32));
  const double turn_s = is_wide ? random.Uniform(0.58, 0.68) : random.Uniform(0.42, 0.5);
  const double stay_s = std::min(random.Uniform(0.1, 0.5), kPeriodS - begin_s - 2.0 * turn_s);  // it is back in time
  const double begin = number * kPeriodS + begin_s;
  return far * (Ease((time_s - begin) / turn_s) - Ease((time_s - begin - turn_s - stay_s) / turn_s));
}

}  // namespace

Rigid3 LookAlong(const Eigen::Vector3d& position, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = forward.normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3::FromMatrix(rotation, position);
}

CarTrajectory::CarTrajectory(const Polyline& drive, double speed, uint32_t seed, const CarMotion& motion,
                             std::shared_ptr<const Terrain> terrain)
    : points_(Resample(drive, kStepM)), waits_(motion.waits), seed_(seed), terrain_(std::move(terrain)) {
  const auto at = [&](ptrdiff_t i) {
    return points_[static_cast<size_t>(std::clamp<ptrdiff_t>(i, 0, static_cast<ptrdiff_t>(points_.size()) - 1))];
  };
  std::vector<double> speeds(points_.size());
  for (size_t i = 0; i < points_.size(); ++i) {
    // Curvature over 3 m: |second difference| / step^2.
    auto k = static_cast<ptrdiff_t>(i);
    if (motion.drives_on)
      k = std::clamp<ptrdiff_t>(k, 12, std::max<ptrdiff_t>(12, static_cast<ptrdiff_t>(points_.size()) - 13));
    const double curvature = (at(k - 12) - 2.0 * at(k) + at(k + 12)).norm() / (9.0);
    speeds[i] = std::min(motion.cruise_mps, std::sqrt(motion.side_acceleration_mps2 / std::max(curvature, 1e-4)));
  }
  const auto point_of = [&](const Wait& wait) {
    return std::min(static_cast<size_t>(std::lround(wait.at_m / kStepM)), points_.size() - 1);
  };
  for (const Wait& wait : waits_) speeds[point_of(wait)] = 0.0;
  // v^2 = u^2 + 2 a s, forwards and backwards.
  const double gain = 2.0 * motion.acceleration_mps2 * kStepM;
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
  double waited_s = 0.0;
  for (const Wait& wait : waits_) {
    wait_times_s_.push_back(times_s_[point_of(wait)] + waited_s);
    waited_s += wait.duration_s;
  }
}

double CarTrajectory::duration_s() const {
  double duration_s = times_s_.back();
  for (const Wait& wait : waits_) duration_s += wait.duration_s;
  return duration_s;
}

double CarTrajectory::DrivenAt(double time_s) const {
  double driven_s = time_s;
  for (size_t i = 0; i < waits_.size(); ++i) {
    driven_s -= std::clamp(time_s - wait_times_s_[i], 0.0, waits_[i].duration_s);
  }
  return driven_s;
}

double CarTrajectory::DistanceAt(double time_s) const { return DistanceOn(times_s_, DrivenAt(time_s)); }
Eigen::Vector2d CarTrajectory::PointAt(double distance_m) const { return PointOn(points_, distance_m); }

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
  const double driven_s = DrivenAt(time_s);  // a car that stands doesn't sway
  const auto sway = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed_, axis), hertz * driven_s); };
  const double heave = 0.012 * sway(1, 3.0);
  double height = kCameraHeightM;
  double slope = 0.0;
  if (terrain_) {
    // Between the wheels, 1.4 m before and behind the camera.
    const double before = terrain_->HeightAt(position + 1.4 * direction);
    const double behind = terrain_->HeightAt(position - 1.4 * direction);
    height += 0.5 * (before + behind);
    slope = (before - behind) / 2.8;
  }
  const Rigid3 level = LookAlong({position.x(), -height + heave, position.y()}, {direction.x(), -slope, direction.y()});
  // Small angles as half-angle quaternions: no trigonometry, exact arithmetic.
  const double pitch = 0.006 * sway(2, 2.1) + 0.003 * sway(3, 5.0);
  const double roll = 0.005 * sway(4, 1.7);
  const double yaw = 0.003 * sway(5, 1.1);
  const Eigen::Quaterniond nod = Eigen::Quaterniond(1.0, 0.5 * pitch, 0.5 * yaw, 0.5 * roll).normalized();
  return {(level.rotation * nod).normalized(), level.translation};
}

WalkTrajectory::WalkTrajectory(const Polyline& way, double speed, uint32_t seed)
    : points_(Resample(way, kStepM)), times_s_{0.0}, seed_(seed) {
  constexpr double kWalkMps = 2.1;
  for (size_t i = 1; i < points_.size(); ++i) {
    const double haste = 1.0 + 0.25 * SmoothNoise(HashOf(seed, 1), kStepM * static_cast<double>(i) / 5.0);
    times_s_.push_back(times_s_.back() + kStepM / (speed * kWalkMps * haste));
  }
}

Rigid3 WalkTrajectory::WorldFromCamera(double time_s) const {
  constexpr double kGaitHz = 0.93;  // of two steps
  const double distance = DistanceOn(times_s_, time_s);
  const Eigen::Vector2d position = PointOn(points_, distance);
  const Eigen::Vector2d direction = (PointOn(points_, distance + 0.8) - PointOn(points_, distance - 0.8)).normalized();
  const auto sway = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed_, axis), hertz * time_s); };
  const double gait = Wave(kGaitHz * time_s);
  const double bob = Wave(2.0 * kGaitHz * time_s);
  const Eigen::Vector2d aside = (0.03 * gait + 0.03 * sway(2, 0.5)) * RightOf(direction);
  const double height = kCameraHeightM + 0.035 * bob;
  const Rigid3 level =
      LookAlong({position.x() + aside.x(), -height, position.y() + aside.y()}, {direction.x(), 0.0, direction.y()});
  const double pitch = 0.03 * sway(3, 0.7) + 0.015 * bob;
  const double roll = 0.035 * gait + 0.03 * sway(4, 0.6);
  const double yaw = 0.03 * gait + 0.16 * sway(5, 0.22);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(1.0, 0.5 * pitch, 0.5 * yaw, 0.5 * roll).normalized();
  return {(level.rotation * turn).normalized(), level.translation};
}

Rigid3 DeskTrajectory::WorldFromCamera(double time_s) const {
  const double time = speed() * time_s;
  const auto noise = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed(), 21, axis), hertz * time); };
  const double shift = static_cast<double>(UnitOf(HashOf(seed(), 22)));
  const Eigen::Vector3d position(0.6 * Wave(time / 9.0 + shift) + 0.15 * noise(1, 0.5) + 0.003 * noise(2, 5.0),
                                 -1.3 + 0.18 * Wave(time / 6.3 + shift) + 0.05 * noise(3, 0.8) + 0.003 * noise(4, 4.0),
                                 -0.75 + 0.25 * Wave(time / 7.7) + 0.1 * noise(5, 0.6));
  const Eigen::Vector3d target(0.5 * Wave(time / 5.5 + shift) + 0.2 * noise(6, 0.7), -0.85 + 0.12 * noise(7, 0.6),
                               0.1 + 0.2 * noise(8, 0.5));
  const Rigid3 level = LookAlong(position, target - position);
  // Tangents of half the angle: no trigonometry.
  const double aside = AsideAt(time, seed());
  const double pitch = 0.01 * noise(9, 3.0) + 0.12 * aside;
  const double roll = 0.05 * noise(10, 0.7) + 0.006 * noise(11, 4.0);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(1.0, pitch, aside + 0.006 * noise(12, 4.5), roll).normalized();
  return {(level.rotation * turn).normalized(), position};
}

Rigid3 OfficeTrajectory::WorldFromCamera(double time_s) const {
  const double time = speed() * time_s;
  const auto noise = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed(), 24, axis), hertz * time); };
  const double shift = static_cast<double>(UnitOf(HashOf(seed(), 25)));
  const Eigen::Vector3d position(0.35 * Wave(time / 7.0 + shift) + 0.08 * noise(1, 0.5) + 0.003 * noise(2, 5.0),
                                 -1.45 + 0.2 * Wave(time / 5.3 + shift) + 0.003 * noise(3, 4.0),
                                 -2.7 + 0.2 * Wave(time / 6.1) + 0.05 * noise(4, 0.6));
  const Eigen::Vector3d target(0.35 * Wave(time / 8.3 + shift) + 0.1 * noise(5, 0.7), -0.95 + 0.12 * noise(6, 0.6),
                               0.2);
  const Rigid3 level = LookAlong(position, target - position);
  // Tangents of half the angle: no trigonometry.
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(1.0, 0.006 * noise(7, 3.0), 0.006 * noise(8, 3.0), 0.04 * noise(9, 0.7)).normalized();
  return {(level.rotation * turn).normalized(), position};
}

Rigid3 HandTrajectory::WorldFromCamera(double time_s) const {
  const double round = speed() * time_s / 20.0;  // one round takes 20 s
  const double shift = static_cast<double>(UnitOf(HashOf(seed(), 1)));
  const auto tremor = [&](uint32_t axis) {
    return 0.012 * SmoothNoise(HashOf(seed(), axis), 1.3 * time_s) +
           0.003 * SmoothNoise(HashOf(seed(), axis, 1), 5.0 * time_s);
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

// The way along the round is slow at both ends of the flight.
double FlightTrajectory::FlownAt(double time_s) const {
  constexpr double kRampS = 5.0;
  // The integral of Ease().
  const auto begun = [](double t_s) {
    const double t = std::clamp(t_s / kRampS, 0.0, 1.0);
    return kRampS * t * t * t * (1.0 - 0.5 * t) + std::max(0.0, t_s - kRampS);
  };
  const double all_s = duration_s() - kFlightStandsS, t_s = time_s - kFlightStandsS;
  return t_s < 0.5 * all_s ? begun(t_s) : 2.0 * begun(0.5 * all_s) - begun(all_s - t_s);
}

Eigen::Vector3d FlightTrajectory::PositionAt(double time_s) const {
  constexpr double kRiseS = 2.5, kGroundM = 0.15;
  const double up = Ease((time_s - kFlightStandsS) / kRiseS) * Ease((duration_s() - time_s) / kRiseS);
  const double flown_s = speed() * FlownAt(time_s);
  const auto noise = [&](uint32_t axis, double hertz) {
    return SmoothNoise(HashOf(seed(), 26, axis), hertz * flown_s);
  };
  const double direction = seed() % 2 == 0 ? 1.0 : -1.0;
  const double round =
      static_cast<double>(UnitOf(HashOf(seed(), 27))) + direction * (flown_s / 13.0 + 0.05 * noise(1, 0.2));
  const double wide = 1.0 + 0.12 * noise(2, 0.25);
  return {3.8 * wide * Wave(round), -kGroundM - up * (1.5 + 0.5 * noise(3, 0.3) + 0.08 * noise(4, 1.1)),
          2.7 * wide * Wave(round + 0.25)};
}

Rigid3 FlightTrajectory::WorldFromCamera(double time_s) const {
  constexpr double kStepS = 0.2, kGravity_mps2 = 9.8;
  const double flown_s = speed() * FlownAt(time_s);
  const auto noise = [&](uint32_t axis, double hertz) {
    return SmoothNoise(HashOf(seed(), 28, axis), hertz * flown_s);
  };
  const auto shake = [&](uint32_t axis) { return 0.0006 * SmoothNoise(HashOf(seed(), 29, axis), 23.0 * time_s); };
  const Eigen::Vector3d before = PositionAt(time_s - kStepS), position = PositionAt(time_s),
                        after = PositionAt(time_s + kStepS);
  const double stands_s = std::min(time_s - kFlightStandsS, duration_s() - time_s);
  const double aloft = Ease(stands_s / 3.0);
  // Looks outwards and ahead, and about.
  const Eigen::Vector3d out = Eigen::Vector3d(position.x(), 0.0, position.z()).normalized();
  const Eigen::Vector3d way((after - before).x(), 0.0, (after - before).z());
  const Rigid3 level = LookAlong(position, out + 0.9 / (2.0 * kStepS * 1.5) * way);
  // Thrust is along the body's axis, which leans by the acceleration over gravity. Tangents of half the angles.
  const Eigen::Vector3d acceleration = (after - 2.0 * position + before) / (kStepS * kStepS);
  const Eigen::Vector3d lean = aloft / kGravity_mps2 * (level.rotation.conjugate() * acceleration);
  const double yaw = aloft * (0.22 * noise(1, 0.35) + 0.05 * noise(2, 1.2));
  const double pitch = aloft * 0.03 * noise(3, 1.5) - 0.5 * lean.z() + shake(1) - 0.05;
  const double roll = aloft * 0.03 * noise(4, 1.5) + 0.5 * lean.x() + shake(2);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(1.0, 0.0, yaw, 0.0).normalized();
  const Eigen::Quaterniond tilt = Eigen::Quaterniond(1.0, pitch, 0.0, roll).normalized();
  const Eigen::Quaterniond bump = Eigen::Quaterniond(1.0, BumpAt(time_s), 0.0, -BumpAt(time_s)).normalized();
  return {(level.rotation * turn * tilt * bump).normalized(), position};
}

// It hits something at a third and at two thirds of its way, and while it stands: within 0.1 s it tips over, and back.
double FlightTrajectory::BumpAt(double time_s) const {
  constexpr double kBumpS = 0.1;
  double bump = 0.0;
  for (const double at_s : {1.0, duration_s() / 3.0, duration_s() / 1.5}) {
    bump += Ease((time_s - at_s) / kBumpS) * Ease((at_s + 2.0 * kBumpS - time_s) / kBumpS);
  }
  return bumps_ * bump;
}

RobotTrajectory::RobotTrajectory(const Eigen::Vector3d& room_m, double speed, uint32_t seed) : seed_(seed) {
  constexpr double kSpeed_mps = 0.35, kQuarter_s = 1.57;
  constexpr int kNumRounds = 2;
  const double side = seed % 2 == 0 ? 1.0 : -1.0;  // it turns left or right
  const double x = side * 0.235 * room_m.x(), z = 0.22 * room_m.z();
  const std::array<Eigen::Vector2d, 4> corners{{{x, z}, {-x, z}, {-x, -z}, {x, -z}}};
  const auto ahead_of = [&](int side_of_way) -> Eigen::Vector2d {
    const size_t i = static_cast<size_t>(side_of_way) % 4;
    return (corners[i] - corners[(i + 3) % 4]).normalized();
  };
  legs_.push_back({0.0, 0.0, corners[3], corners[3], ahead_of(0), ahead_of(0)});
  for (int i = 0; i < 4 * kNumRounds; ++i) {
    const Eigen::Vector2d& corner = corners[static_cast<size_t>(i) % 4];
    Add((corner - legs_.back().to).norm() / (speed * kSpeed_mps), corner, ahead_of(i));
    if (i % 2 == 1) {  // the long way around
      Add(kQuarter_s / speed, corner, -ahead_of(i + 1));
      Add(kQuarter_s / speed, corner, -ahead_of(i));
    }
    Add(kQuarter_s / speed, corner, ahead_of(i + 1));
  }
}

void RobotTrajectory::Add(double duration_s, const Eigen::Vector2d& to, const Eigen::Vector2d& ahead_to) {
  const Leg& last = legs_.back();
  legs_.push_back({last.end_s, last.end_s + duration_s, last.to, to, last.ahead_to, ahead_to});
}

Rigid3 RobotTrajectory::WorldFromCamera(double time_s) const {
  constexpr double kHeightM = 0.55, kAheadOfAxleM = 0.08;
  const auto after = std::find_if(legs_.begin() + 1, legs_.end() - 1, [&](const Leg& l) { return time_s < l.end_s; });
  const Leg& leg = *after;
  const double t = Ease((time_s - leg.begin_s) / (leg.end_s - leg.begin_s));
  const Eigen::Vector2d axle = leg.from + t * (leg.to - leg.from);
  const Eigen::Vector2d ahead = (leg.ahead_from + t * (leg.ahead_to - leg.ahead_from)).normalized();
  const Eigen::Vector2d position = axle + kAheadOfAxleM * ahead;
  const auto rattle = [&](uint32_t axis) { return 0.001 * SmoothNoise(HashOf(seed_, 31, axis), 9.0 * time_s); };
  const Rigid3 level = LookAlong({position.x(), -kHeightM + rattle(0), position.y()}, {ahead.x(), 0.0, ahead.y()});
  const Eigen::Quaterniond shake = Eigen::Quaterniond(1.0, rattle(1), 0.0, rattle(2)).normalized();
  return {(level.rotation * shake).normalized(), level.translation};
}

}  // namespace tessera
