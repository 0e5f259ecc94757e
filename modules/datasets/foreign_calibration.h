// Calibration files as other tools write them: Kalibr's camchain.yaml (cam0 and, for a pair, cam1), and what ROS's
// camera_calibration saves for one camera.
#pragma once

#include <optional>

#include "datasets/calibration_section.h"
#include "datasets/camera_rig.h"

namespace tessera {

// nullopt if the file has neither form. Throws InputError if it has one and something in it is missing, wrong or not
// supported.
std::optional<CameraRig> ReadForeignCalibration(const CalibrationSection& file);

}  // namespace tessera
