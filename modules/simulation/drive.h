// Where a camera goes: its pose at any time. Times are seconds from the start; the camera frame looks along z, y down.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/rigid3.h"
#include "simulation/street_map.h"

namespace tessera {

// A town and a drive through it.
struct StreetPlan {
  std::vector<Polyline> streets;  // middle lines, m
  Polyline drive;                 // the car's way, m
};

// A walk over the crossings of a small town of bent streets, with several revisits in the same lane and in the other.
// Only the first `length_m` of the drive are driven; 0: all of it.
StreetPlan PlanTown(uint32_t seed, double length_m);
// One round of blocks that overlaps its beginning by some 40 m.
StreetPlan PlanRound(uint32_t seed, double length_m);
// A drive along the true trajectory of a KITTI sequence (rows of 3x4 matrices); heights are ignored. Throws InputError.
StreetPlan PlanFromPoses(const std::string& path, double length_m);

class Trajectory {
 public:
  virtual ~Trajectory() = default;
  virtual double duration_s() const = 0;
  virtual Rigid3 WorldFromCamera(double time_s) const = 0;
};

// A car that slows down in bends, on a suspension that nods, rolls and heaves a little.
class CarTrajectory : public Trajectory {
 public:
  // `speed` times the usual 8 m/s.
  CarTrajectory(const Polyline& drive, double speed, uint32_t seed);
  double duration_s() const override;
  Rigid3 WorldFromCamera(double time_s) const override;
  // The car's position on the ground and its direction.
  Eigen::Vector2d PositionAt(double time_s) const;
  Eigen::Vector2d DirectionAt(double time_s) const;

 private:
  double DistanceAt(double time_s) const;
  Eigen::Vector2d PointAt(double distance_m) const;

  Polyline points_;              // every kStepM
  std::vector<double> times_s_;  // by point
  uint32_t seed_;
};

// A camera in someone's hand who walks around in a room of this size and looks about. Comes back to its start.
class HandTrajectory : public Trajectory {
 public:
  HandTrajectory(const Eigen::Vector3d& room_m, double duration_s, double speed, uint32_t seed);
  double duration_s() const override { return duration_s_; }
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  Eigen::Vector3d room_m_;
  double duration_s_;
  double speed_;
  uint32_t seed_;
};

// The camera at `position` that looks along `forward` with its y axis downwards; `forward` must not be vertical.
Rigid3 LookAlong(const Eigen::Vector3d& position, const Eigen::Vector3d& forward);

}  // namespace tessera
