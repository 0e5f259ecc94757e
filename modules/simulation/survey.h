// Fields as a drone sees them that looks straight down: nearly a plane.
#pragma once

#include <cstdint>

#include "simulation/drive.h"
#include "simulation/world.h"

namespace tessera {

// Above fields around the origin, 30 m high at 6 m/s: along parallel lines of 120 m, 16 m apart, back and forth, then
// across them to where it began. It leans forward as it flies and sways in the wind; the top of its picture is ahead.
class SurveyTrajectory : public Trajectory {
 public:
  // `speed` times the usual.
  SurveyTrajectory(double speed, uint32_t seed);
  double duration_s() const override;
  Rigid3 WorldFromCamera(double time_s) const override;

 private:
  Eigen::Vector2d PositionAt(double time_s) const;

  Polyline points_;  // every kStepM
  double speed_mps_;
  uint32_t seed_;
};

// Strips of fields, paths between them, bushes up to 1.5 m high, and a few barns.
World BuildFields(uint32_t seed);

}  // namespace tessera
