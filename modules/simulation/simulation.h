// A simulated drive or walk: any frame of it, with its exact pose. The same options give the same bytes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/result.h"
#include "geometry/camera_frame.h"
#include "simulation/camera_effects.h"
#include "simulation/drive.h"
#include "simulation/renderer.h"

namespace tessera {

struct SimulationOptions {
  enum class Scene {
    kStreet,
    kStreetShort,
    kTraffic,
    kHighway,
    kRoom,
    kCountry,
    kWalk,
    kDesk,
    kOffice,
    kRobot,
    kFlight,
    kSurvey
  };
  Scene scene = Scene::kStreet;
  uint32_t seed = 1;            // another seed, another town
  double length_m = 0.0;        // of a drive; 0: all of it
  double duration_s = 0.0;      // of the way in the room, at the desk or in the hall; 0: 20 s, or 60 s of flight
  double speed = 1.0;           // times the usual
  double noise = 1.0;           // times the usual noise of sensors
  double scale = 1.0;           // times the usual size of images
  double readout_ms = -1.0;     // rolling shutter: from the first row to the last; -1: that of the world's camera
  double depth_delay_ms = 0.0;  // RGB-D: depth is taken so much later than the image, as by a Kinect
  double right_delay_ms = 0.0;  // stereo: the right image is taken so much later than the left one
  double stop_m = 12.0;         // traffic: it stops so far before the middle of a crossing
  double body = 0.0;            // share of the image's height that shows the car or robot itself, at the bottom
  double people = 3.0;          // office: who walks around
  double bumps = 0.0;           // flight: how hard it is knocked three times; 0.3: by 45 degrees
  double squint = 0.0;          // stereo: degrees by which the right camera is turned inwards, which nobody is told
  double twist = 0.0;           // likewise about its optical axis
  double pitch = 0.0;           // likewise upwards
  double stamp = 0.0;           // 1: the time is written into the image, as dashcams do
  std::string path;             // a drive along the poses of a KITTI file instead of through the town

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Reads the name of a world (street, street-short, traffic, highway, room, country, walk, desk, office, robot, flight)
// and options behind it: "street,seed=3,length=500". Throws InputError.
SimulationOptions ParseSimulation(const std::string& text);

class Simulation {
 public:
  // Throws InputError.
  Simulation(const SimulationOptions& options, SensorType sensor);
  ~Simulation();

  const CameraCalibration& calibration() const { return camera_; }
  int64_t num_frames() const { return num_frames_; }
  int64_t UtimeOf(FrameId frame) const;
  // The pose at the middle row, if the shutter rolls.
  Rigid3 WorldFromCamera(FrameId frame) const;
  // The pose when this row was exposed; depth rolls with the image.
  Rigid3 WorldFromCameraAtRow(FrameId frame, double row) const;
  // Frames may be rendered in any order.
  CameraFrame Render(FrameId frame);
  // The picture before the effects of the camera.
  void RenderPerfect(FrameId frame, Rendering& out);

 private:
  double TimeOf(FrameId frame) const;
  CameraVelocity VelocityAt(double time_s) const;
  Rigid3 WorldFromCameraAt(double time_s, double row) const;
  // The picture of the left camera, or of one this far to its right, whose middle row is exposed at this time.
  void RenderEye(double time_s, double right_m, Rendering& out);

  SimulationOptions options_;
  CameraCalibration camera_;
  double frames_per_s_ = 10.0;
  double readout_s_ = 0.0;
  int64_t num_frames_ = 0;
  std::shared_ptr<const Trajectory> trajectory_;
  std::unique_ptr<Renderer> renderer_;
  std::unique_ptr<EffectsPipeline> effects_;
  Rendering rendering_;
};

}  // namespace tessera
