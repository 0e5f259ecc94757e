#include "occupancy/occupancy_options.h"

namespace tessera {
namespace {

// OctoMap has 2^16 voxels along each axis, and room for 100,000 voxels of a ray.
constexpr double kMaxVoxelsPerRay = 10'000.0;

}  // namespace

Result<> OccupancyOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(Require(resolution > 0.0, "the resolution must be positive"));
  TESSERA_RETURN_IF_FAILED(Require(max_range >= 2.0 * resolution, "the maximum range is below two voxels"));
  TESSERA_RETURN_IF_FAILED(
      Require(max_range <= kMaxVoxelsPerRay * resolution, "the maximum range is above 10,000 voxels"));
  TESSERA_RETURN_IF_FAILED(Require(prob_hit > 0.5 && prob_hit < 1.0, "prob_hit must lie between 0.5 and 1"));
  TESSERA_RETURN_IF_FAILED(Require(prob_miss > 0.0 && prob_miss < 0.5, "prob_miss must lie between 0 and 0.5"));
  TESSERA_RETURN_IF_FAILED(Require(prob_min > 0.0 && prob_min < 0.5, "prob_min must lie between 0 and 0.5"));
  return Require(prob_max > 0.5 && prob_max < 1.0, "prob_max must lie between 0.5 and 1");
}

OccupancyOptions FitToSensor(OccupancyOptions options, const CameraCalibration& camera) {
  double resolution = 0.0, max_range = 0.0;
  switch (camera.sensor) {
    case SensorType::kRgbd:
      resolution = 0.025;
      max_range = 4.0;
      break;
    case SensorType::kStereo:
      resolution = 0.4 * camera.baseline_m;
      max_range = 40.0 * camera.baseline_m;
      break;
    case SensorType::kMono:
      resolution = 0.05;
      max_range = 5.0;
      break;
  }
  if (options.resolution == 0.0) options.resolution = resolution;
  if (options.max_range == 0.0) options.max_range = max_range;
  return options;
}

}  // namespace tessera
