// The images that a vocabulary is trained on: frames of sources, and views cut out of the photos in folders.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/image.h"
#include "geometry/camera.h"

namespace tessera {

struct TrainingViewOptions {
  int64_t every = 10;            // of a source, every so many frames: neighbors show the same
  int num_views = 4;             // of a photo: all of it, and parts of it as if seen from nearer
  std::string calibration_path;  // of the sources that need one (SourceOptions)
  uint64_t seed = 1;             // of the choice of parts
};

// Calls `use` with each image and its camera; of photos, whose camera nobody knows, a plausible one. `source` is as in
// SourceOptions, log:FILE, or a folder, whose photos are taken in order of their paths, those in folders below it too.
// Returns a sentence for each photo that can't be read and is left out. Throws InputError if a source can't be read.
std::vector<std::string> ForEachTrainingView(
    const std::string& source, const TrainingViewOptions& options,
    const std::function<void(const GrayImage&, const CameraCalibration&)>& use);

}  // namespace tessera
