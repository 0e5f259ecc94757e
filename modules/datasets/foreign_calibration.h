// Calibration files as others write them: Kalibr's camchain.yaml (cam0 and, for a pair, cam1), what ROS's
// camera_calibration saves for one camera, and the sensor.yaml of each camera of a EuRoC sequence.
#pragma once

#include <optional>

#include "datasets/calibration_section.h"
#include "datasets/camera_rig.h"

namespace tessera {

// Kalibr's or ROS's; nullopt if the file has neither form. Throws InputError if it has one and something in it is
// missing, wrong or not supported.
std::optional<CameraRig> ReadForeignCalibration(const CalibrationSection& file);

struct CameraOnBody {
  PinholeCamera camera;
  Rigid3 body_from_camera;
};

// EuRoC's sensor.yaml. Throws InputError likewise.
CameraOnBody ReadEurocSensor(const CalibrationSection& file);

}  // namespace tessera
