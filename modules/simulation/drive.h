// Where a camera goes: its pose at any time. Times are seconds from the start; the camera frame looks along z, y down.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/rigid3.h"
#include "simulation/street_map.h"
#include "simulation/terrain.h"

namespace tessera {

class Trajectory {
 public:
  virtual ~Trajectory() = default;
  virtual double duration_s() const = 0;
  virtual Rigid3 WorldFromCamera(double time_s) const = 0;
};

// A car that stands at this distance along its way for so long.
struct Wait {
  double at_m = 0.0;
  double duration_s = 0.0;
};

// How someone drives.
struct CarMotion {
  double cruise_mps = 8.0;
  double side_acceleration_mps2 = 2.2;  // at most, in bends
  double acceleration_mps2 = 1.6;       // at most, along the way
  bool drives_on = false;               // the way is part of a longer one; else the car starts and ends slowly
  std::vector<Wait> waits;              // in their order
};

// A car that slows down in bends, on a suspension that nods, rolls and heaves a little.
class CarTrajectory : public Trajectory {
 public:
  // `speed` times the usual. The ground is `terrain`, or level without one.
  CarTrajectory(const Polyline& drive, double speed, uint32_t seed, const CarMotion& motion = {},
                std::shared_ptr<const Terrain> terrain = nullptr);
  double duration_s() const override;
  Rigid3 WorldFromCamera(double time_s) const override;
  // Along the way, m.
  double DistanceAt(double time_s) const;
  // When the waits begin.
  const std::vector<double>& wait_times_s() const { return wait_times_s_; }
  // The car's position on the ground and its direction.
  Eigen::Vector2d PositionAt(double time_s) const;
  Eigen::Vector2d DirectionAt(double time_s) const;

 private:
  // The time for which the car has moved.
  double DrivenAt(double time_s) const;
  Eigen::Vector2d PointAt(double distance_m) const;

  Polyline points_;              // every kStepM
  std::vector<double> times_s_;  // by point, without the waits
  std::vector<Wait> waits_;
  std::vector<double> wait_times_s_;
  uint32_t seed_;
  std::shared_ptr<const Terrain> terrain_;
};

// A camera on someone who walks: it sways and bobs with the steps, and looks about.
class WalkTrajectory : public Trajectory {
 public:
  // `speed` times the usual 2.1 m/s, which varies by a quarter.
  WalkTrajectory(const Polyline& way, double speed, uint32_t seed);
  double duration_s() const override { return times_s_.back(); }
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  Polyline points_;              // every kStepM
  std::vector<double> times_s_;  // by point
  uint32_t seed_;
};

// A camera that goes about freely for so long.
class FreeTrajectory : public Trajectory {
 public:
  FreeTrajectory(double duration_s, double speed, uint32_t seed)
      : duration_s_(duration_s), speed_(speed), seed_(seed) {}
  double duration_s() const override { return duration_s_; }

 protected:
  double speed() const { return speed_; }  // times the usual
  uint32_t seed() const { return seed_; }

 private:
  double duration_s_;
  double speed_;
  uint32_t seed_;
};

// In the hand of someone who walks around in a room of this size and looks about. Comes back to its start.
class HandTrajectory : public FreeTrajectory {
 public:
  HandTrajectory(const Eigen::Vector3d& room_m, double duration_s, double speed, uint32_t seed)
      : FreeTrajectory(duration_s, speed, seed), room_m_(room_m) {}
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  Eigen::Vector3d room_m_;
};

// In the hand of someone who looks at a desk (see BuildDesk) from all around it, and every few seconds quickly aside
// and back, at up to some 3 rad/s.
class DeskTrajectory : public FreeTrajectory {
 public:
  using FreeTrajectory::FreeTrajectory;
  Rigid3 WorldFromCamera(double time_s) const override;
};

// In the hand of someone who stands 2.7 m before the desk and films it, at some 0.25 m/s.
class OfficeTrajectory : public FreeTrajectory {
 public:
  using FreeTrajectory::FreeTrajectory;
  Rigid3 WorldFromCamera(double time_s) const override;
};

// On a quadrotor in a hall (see BuildHall): it stands for 2 s with its rotors running, takes off, flies rounds at some
// 1.5 m/s, leans into what it accelerates to, looks about, and lands.
class FlightTrajectory : public FreeTrajectory {
 public:
  // `bumps`: the tangent of half the angle by which it is knocked over, on its ground and twice on its way.
  FlightTrajectory(double duration_s, double speed, uint32_t seed, double bumps)
      : FreeTrajectory(duration_s, speed, seed), bumps_(bumps) {}
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  double FlownAt(double time_s) const;
  Eigen::Vector3d PositionAt(double time_s) const;
  double BumpAt(double time_s) const;

  double bumps_;
};

// A camera low on a wheeled robot that goes twice around the table in the middle of a room of this size: along a
// rectangle, and at its corners it stops and turns where it stands, at every second one by 270 degrees.
class RobotTrajectory : public Trajectory {
 public:
  // `speed` times the usual 0.35 m/s and, in turns, 1 rad/s.
  RobotTrajectory(const Eigen::Vector3d& room_m, double speed, uint32_t seed);
  double duration_s() const override { return legs_.back().end_s; }
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  // Straight on, or a quarter of a turn. Positions and directions on the ground (x, z).
  struct Leg {
    double begin_s, end_s;
    Eigen::Vector2d from, to;
    Eigen::Vector2d ahead_from, ahead_to;
  };
  void Add(double duration_s, const Eigen::Vector2d& to, const Eigen::Vector2d& ahead_to);

  std::vector<Leg> legs_;
  uint32_t seed_;
};

// The camera at `position` that looks along `forward` with its y axis downwards; `forward` must not be vertical.
Rigid3 LookAlong(const Eigen::Vector3d& position, const Eigen::Vector3d& forward);

}  // namespace tessera
