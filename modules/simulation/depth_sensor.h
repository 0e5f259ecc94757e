// A depth camera that projects a pattern of infrared dots and matches it, as the first Kinect does.
#pragma once

#include <cstdint>

#include "core/image.h"
#include "geometry/camera.h"
#include "simulation/renderer.h"

namespace tessera {

// Depth z is measured as a disparity d = focal_baseline / z, so that its error grows with z^2. The figures are those of
// Khoshelham and Elberink (2012): steps of 2.9 mm/m^2, standard deviation 1.4 mm/m^2, steps included.
struct DepthSensor {
  double baseline_m = 0.075;          // from the camera to the projector, to its left
  double focal_baseline_px_m = 43.5;  // of the infrared camera
  double disparity_step_px = 0.125;
  double disparity_noise_px = 0.049;  // standard deviation
  double nearest_m = 0.5;             // nothing is measured nearer
  double farthest_m = 4.5;            // nor farther
  double steep_cosine = 0.2;          // nor at a surface whose normal has a smaller cosine to the ray
  double dark_gray = 20.0;            // nor, mostly, where no light returns
};

// Depth counts of calibration.depth_unit_m; 0: not measured. Besides the limits above there is no depth at the
// picture's left and right border, where a nearer object keeps the pattern off, and in spots along edges of objects;
// such edges fray by up to 2 px. `picture` numbers the pictures.
DepthImage MeasureDepth(const Rendering& rendering, const CameraCalibration& camera, const DepthSensor& sensor,
                        uint32_t seed, uint32_t picture);

}  // namespace tessera
