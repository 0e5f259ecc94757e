#include "datasets/frame_source.h"

#include <opencv2/core/utility.hpp>

#include "core/errors.h"
#include "datasets/aligned_source.h"
#include "datasets/doubled_source.h"
#include "datasets/recording.h"
#include "datasets/simulated_source.h"
#include "datasets/stream_source.h"

namespace tessera {
namespace {

constexpr const char* kKinds = "kitti:DIR, euroc:DIR, tum:DIR, video:FILE, camera:N, rtsp://..., sim:NAME or log:FILE";

std::unique_ptr<FrameSource> Open(const SourceOptions& options) {
  const std::string& source = options.source;
  const std::string kind = source.substr(0, source.find(':'));
  const std::string rest = source.size() > kind.size() ? source.substr(kind.size() + 1) : "";
  if (rest.empty()) {
    throw InputError("source `" + source + "` must be " + kKinds);
  }
  if (kind == "kitti") return PlayRecording(LoadKitti(rest, options), options);
  if (kind == "euroc") return PlayRecording(LoadEuroc(rest, options), options);
  if (kind == "tum") return PlayRecording(LoadTum(rest, options), options);
  if (kind == "sim") return OpenSimulation(rest, options);
  if (kind == "video") return OpenVideoFile(rest, options);
  if (kind == "camera") return OpenDevice(rest, options);
  if (kind == "rtsp" || kind == "rtsps") return OpenNetworkStream(source, options);
  throw InputError("source `" + source + "` is of an unknown kind: give " + kKinds);
}

}  // namespace

SensorType ParseSensor(const std::string& text) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo, SensorType::kRgbd}) {
    if (text == ToString(sensor)) {
      return sensor;
    }
  }
  throw InputError("sensor `" + text + "` is unknown: give mono, stereo or rgbd");
}

std::unique_ptr<FrameSource> OpenSource(const SourceOptions& options) {
  cv::setNumThreads(1);  // parallelism is between processes; the cores belong to the extractors
  return DoubleIfSmall(AlignRows(Open(options), options, Open), options.min_focal_px);
}

}  // namespace tessera
