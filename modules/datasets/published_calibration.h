// Calibrations that the makers of a data set publish on its page, not in its folders.
#pragma once

#include <optional>
#include <string>

#include "datasets/camera_rig.h"

namespace tessera {

struct PublishedCalibration {
  std::string name;  // whose, for notes
  CameraRig rig;
};

// The color camera of a sequence of the TUM RGB-D benchmark, and its depth unit, by the name that its folder has there:
// rgbd_dataset_freiburg1_*, 2_* or 3_*. nullopt for any other name.
std::optional<PublishedCalibration> PublishedTumCalibration(const std::string& folder);

}  // namespace tessera
