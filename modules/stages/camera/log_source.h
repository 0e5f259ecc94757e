// A recorded LCM log as a source of frames. Frames keep the numbers under which they were recorded.
#pragma once

#include <memory>
#include <string>

#include "datasets/frame_source.h"

namespace tessera {

// Opens log:FILE; the log's channels have this prefix. Of a stereo or RGB-D log, mono takes the left images.
// Throws InputError: see LogReader; wrong sensor; a calibration option (the recorded images are rectified
// already); no frame of the wanted range; `runs_live`: a recording of a live run, which is only ever repeated.
std::unique_ptr<FrameSource> OpenLog(const SourceOptions& options, const std::string& channel_prefix,
                                     bool runs_live = false);

}  // namespace tessera
