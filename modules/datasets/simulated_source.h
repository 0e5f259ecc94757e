// sim:NAME[,key=value...]: frames of a simulated world, with exact ground truth.
#pragma once

#include <memory>
#include <string>

#include "datasets/frame_source.h"

namespace tessera {

// `name` is what follows `sim:` (see ParseSimulation). Throws InputError, also if a calibration file is given: a
// simulated camera has its own.
std::unique_ptr<FrameSource> OpenSimulation(const std::string& name, const SourceOptions& options);

}  // namespace tessera
