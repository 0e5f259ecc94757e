#include "occupancy/occupancy_options.h"

namespace tessera {
namespace {

// OctoMap has 2^16 voxels along each axis, and room for 100,000 voxels of a ray.
constexpr double kMaxVoxelsPerRay = 10'000.0;
// Of stereo.
constexpr double kMinDisparityPx = 6.0;
constexpr double kVoxelsPerRange = 160.0;

}  // namespace

Result<> OccupancyOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(Require(resolution > 0.0, "the resolution must be positive"));
  TESSERA_RETURN_IF_FAILED(
      Require(min_range >= 0.0 && min_range < max_range, "the minimum range is not below the maximum"));
  TESSERA_RETURN_IF_FAILED(Require(max_range >= 2.0 * resolution, "the maximum range is below two voxels"));
  TESSERA_RETURN_IF_FAILED(
      Require(max_range <= kMaxVoxelsPerRay * resolution, "the maximum range is above 10,000 voxels"));
  TESSERA_RETURN_IF_FAILED(Require(prob_hit > 0.5 && prob_hit < 1.0, "prob_hit must lie between 0.5 and 1"));
  TESSERA_RETURN_IF_FAILED(Require(prob_miss > 0.0 && prob_miss < 0.5, "prob_miss must lie between 0 and 0.5"));
  TESSERA_RETURN_IF_FAILED(Require(prob_min > 0.0 && prob_min < 0.5, "prob_min must lie between 0 and 0.5"));
  TESSERA_RETURN_IF_FAILED(Require(min_hits >= 0, "min_hits must not be negative"));
  return Require(prob_max > 0.5 && prob_max < 1.0, "prob_max must lie between 0.5 and 1");
}

OccupancyOptions FitToSensor(OccupancyOptions options, const CameraCalibration& camera) {
  const bool is_stereo = camera.sensor == SensorType::kStereo;
  double resolution = 0.0, max_range = 0.0;
  switch (camera.sensor) {
    case SensorType::kRgbd:
      max_range = 4.0;
      resolution = 0.025;
      break;
    case SensorType::kStereo:
      max_range = camera.fx_px * camera.baseline_m / kMinDisparityPx;
      resolution = max_range / kVoxelsPerRange;
      break;
    case SensorType::kMono:
      max_range = 5.0;
      resolution = 0.05;
      break;
  }
  if (options.resolution == 0.0) options.resolution = resolution;
  if (options.max_range == 0.0) options.max_range = max_range;
  if (options.min_hits == 0) options.min_hits = is_stereo ? 2 : 1;
  return options;
}

}  // namespace tessera
