// Videos and cameras as sources: one image after another, mono. The calibration comes from a file.
#pragma once

#include <memory>

#include "datasets/frame_source.h"

namespace tessera {

// A video file. Calibration: --camera, or FILE.yaml beside FILE.mp4. Times count from 0 at the file's rate.
std::unique_ptr<FrameSource> OpenVideoFile(const std::string& path, const SourceOptions& options);
// Device /dev/video<index> (V4L2). Frames are numbered as they come.
std::unique_ptr<FrameSource> OpenDevice(const std::string& index, const SourceOptions& options);
// A network stream, such as rtsp://...
std::unique_ptr<FrameSource> OpenNetworkStream(const std::string& url, const SourceOptions& options);

}  // namespace tessera
