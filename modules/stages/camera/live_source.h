// A camera or network stream that may stall, end and come back. A thread of its own reads it, so that the stage goes on
// while no image comes; of images that nobody took, the newest is kept. When the source breaks off it is opened again,
// after pauses that grow from 0.5 to 5 s. Frames are numbered as they come, those too that nobody took, and carry the
// time at which they were taken by this host's clock, us since 1970 (datasets/capture_clock.h).
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "datasets/frame_source.h"

namespace tessera {

struct LiveSourceOptions {
  bool has_host_stamps = false;  // times are of this host's monotonic clock (V4L2)
  int64_t first_frame = 0;       // frames first_frame .. last_frame - 1 are wanted
  int64_t last_frame = -1;       // -1: without end
};

class LiveSource : public FrameSource {
 public:
  // `open` makes the source, each time anew; it throws InputError if it can't. The first time, so does this.
  using Open = std::function<std::unique_ptr<FrameSource>()>;
  LiveSource(Open open, const LiveSourceOptions& options);
  ~LiveSource() override;
  LiveSource(const LiveSource&) = delete;
  LiveSource& operator=(const LiveSource&) = delete;

  const CameraCalibration& calibration() const override { return calibration_; }
  std::optional<int64_t> num_frames() const override;
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  bool HasNext() override;
  // Waits if there is none. nullopt after the last wanted frame. Throws InputError if the source came back as another
  // camera.
  std::optional<CameraFrame> Next() override;
  ColorReader TakeColor() override { return std::exchange(color_, nullptr); }
  bool is_live() const override { return true; }
  const std::vector<std::string>& notes() const override { return notes_; }

  std::vector<std::string> TakeEvents() override;

 private:
  struct Shared;  // with the thread
  static void Run(const std::shared_ptr<Shared>& shared, const Open& open, std::unique_ptr<FrameSource> source);

  const LiveSourceOptions options_;
  CameraCalibration calibration_;
  std::vector<GroundTruthPose> ground_truth_;  // none
  std::vector<std::string> notes_;
  std::shared_ptr<Shared> shared_;
  ColorReader color_;  // of the last frame
};

}  // namespace tessera
