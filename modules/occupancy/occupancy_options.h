// What an occupancy map is made with.
#pragma once

#include "core/result.h"
#include "geometry/camera.h"

namespace tessera {

struct OccupancyOptions {
  double resolution = 0.0;  // edge of a voxel, m (mono: units of the map); 0: see FitToSensor
  double max_range = 0.0;   // rays end here at the latest, in the same unit; 0: likewise
  double prob_hit = 0.7;    // that a voxel is occupied, by one scan that has a point in it
  double prob_miss = 0.4;   // likewise, by one scan whose rays go through it
  double prob_min = 0.12;   // what the octree says of a voxel stays between these
  double prob_max = 0.97;

  Result<> Check() const;
};

// `options` with what is left at 0 filled in by the sensor: how fine and how far it measures.
//
//   RGB-D    resolution 0.025 m, max_range 4 m: structured light
//   stereo   resolution 0.4 baselines, max_range 40 baselines: half a pixel of disparity is one voxel at 24 baselines
//   where
//            the focal length is 700 px
//   mono     resolution 0.05, max_range 5 units of the map, whose first keyframes see points at a median distance of 1
OccupancyOptions FitToSensor(OccupancyOptions options, const CameraCalibration& camera);

}  // namespace tessera
