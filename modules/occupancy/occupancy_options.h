// What an occupancy map is made with.
#pragma once

#include "core/result.h"
#include "geometry/camera.h"

namespace tessera {

struct OccupancyOptions {
  double resolution = 0.0;  // edge of a voxel, m (mono: units of the map); 0: see FitToSensor
  double max_range = 0.0;   // rays end here at the latest, in the same unit; 0: likewise
  double min_range = 0.0;   // what is nearer is of the robot that carries the camera, and is left out
  double prob_hit = 0.7;    // that a voxel is occupied, by one scan that has a point in it
  double prob_miss = 0.4;   // likewise, by one scan whose rays go through it
  double prob_min = 0.12;   // what the octree says of a voxel stays between these
  double prob_max = 0.97;
  int min_hits = 0;  // scans that must have a point in a voxel, so that it is told to be occupied; 0: see FitToSensor

  Result<> Check() const;
};

// `options` with what is left at 0 filled in by the sensor: how far and how finely it measures.
//
//   RGB-D    max_range 4 m, resolution 0.025 m: structured light
//   stereo   max_range f b / 6 px, where half a pixel of disparity is a twelfth of the distance; resolution 1/160 of
//   it,
//            which is half a pixel at 13 px of disparity. Two scans must agree, since a single match may be wrong
//   mono     max_range 5, resolution 0.05 units of the map, whose first keyframes see points at a median distance of 1
OccupancyOptions FitToSensor(OccupancyOptions options, const CameraCalibration& camera);

}  // namespace tessera
