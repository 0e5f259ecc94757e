#include "datasets/simulated_source.h"

#include <algorithm>

#include "core/errors.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

class SimulatedSource : public FrameSource {
 public:
  SimulatedSource(const std::string& name, const SourceOptions& options)
      : simulation_(ParseSimulation(name), options.sensor),
        next_{options.first_frame},
        end_(options.last_frame < 0 ? simulation_.num_frames()
                                    : std::min(options.last_frame, simulation_.num_frames())) {
    if (next_.value >= end_) {
      throw InputError("sim:" + name + " has " + std::to_string(simulation_.num_frames()) +
                       " frames; none of them is in " + std::to_string(options.first_frame) + ":" +
                       std::to_string(options.last_frame));
    }
    for (FrameId frame = next_; frame.value < end_; ++frame.value) {
      ground_truth_.push_back({frame, simulation_.UtimeOf(frame), simulation_.WorldFromCamera(frame)});
    }
  }

  const CameraCalibration& calibration() const override { return simulation_.calibration(); }
  std::optional<int64_t> num_frames() const override { return end_ - ground_truth_.front().frame.value; }
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  std::optional<CameraFrame> Next() override {
    if (next_.value >= end_) return std::nullopt;
    CameraFrame frame = simulation_.Render(next_);
    ++next_.value;
    return frame;
  }
  void SkipTo(FrameId frame) override { next_.value = std::clamp(frame.value, next_.value, end_); }
  bool is_live() const override { return false; }
  const std::vector<std::string>& notes() const override { return notes_; }

 private:
  Simulation simulation_;
  FrameId next_;
  int64_t end_;
  std::vector<GroundTruthPose> ground_truth_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<FrameSource> OpenSimulation(const std::string& name, const SourceOptions& options) {
  if (!options.calibration_path.empty()) {
    throw InputError("sim:" + name + " has its own camera: leave --camera away");
  }
  return std::make_unique<SimulatedSource>(name, options);
}

}  // namespace tessera
