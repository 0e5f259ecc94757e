// From light to gray values: what a real camera adds to a perfect picture.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/image.h"
#include "geometry/camera.h"
#include "simulation/renderer.h"

namespace tessera {

struct CameraEffects {
  double exposure_s = 0.006;     // motion blur: the shutter is open for so long
  int max_blur_taps = 9;         // samples along the motion of one pixel
  double exposure_drift = 0.12;  // the gain wanders within 1 +- this, over some seconds
  // Each eye exposes for longer where it is dark, up to so many times as long, and amplifies what is missing by up to
  // as much again, noise included. 1: it does not.
  double max_exposure = 1.0;
  double vignetting = 0.2;      // light lost in the corners
  double read_noise = 1.3;      // standard deviation in the dark, gray values
  double shot_noise = 0.012;    // variance per gray value of light
  double depth_noise = 0.0015;  // RGB-D: standard deviation of depth per squared meter, 1/m
};

// The camera's velocity in its own frame, per second.
struct CameraVelocity {
  Eigen::Vector3d linear_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero();
};

class EffectsPipeline {
 public:
  EffectsPipeline(const CameraCalibration& camera, const CameraEffects& effects, uint32_t seed);

  // Blurs along the apparent motion, spreads light over neighboring pixels (1 6 1) / 8 in both directions, applies
  // gain and vignetting, adds noise. `picture` numbers the pictures of all eyes; the gain depends on `time_s` alone.
  GrayImage Apply(const Rendering& rendering, const CameraVelocity& velocity, double time_s, uint32_t picture);
  // Depth counts of calibration.depth_unit_m, with noise; 0 where nothing is or the count does not fit.
  DepthImage Depth(const Rendering& rendering, uint32_t picture) const;

 private:
  // Of exposure_s, and of what is then missing.
  struct Exposure {
    double time = 1.0, gain = 1.0;
  };
  Exposure Expose(const Rendering& rendering) const;
  void BlurMotion(const Rendering& rendering, const CameraVelocity& velocity, double exposure_s);
  void Spread();

  CameraCalibration camera_;
  CameraEffects effects_;
  uint32_t seed_;
  RadianceImage blurred_;
  RadianceImage spread_;
  Image<float> vignette_;  // factor by pixel
};

// Writes a date, the time and a camera's number into the image's upper left corner, as dashcams do: white digits with a
// dark border.
void StampTime(double time_s, GrayImage& image);

}  // namespace tessera
