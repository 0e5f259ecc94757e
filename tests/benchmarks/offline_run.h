// Tracking and mapping of a recorded sequence in one thread without the bus, with the deltas taken in logical time.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "datasets/frame_source.h"
#include "evaluation/pose_text.h"
#include "features/feature_types.h"
#include "loop_closing/loop_closer.h"
#include "mapping/mapper.h"
#include "measurement/rolling_shutter.h"
#include "tracking/map_tracker.h"
#include "tracking/tracker_time.h"

namespace tessera {

// The features of a sequence, and what is known of the truth.
struct FeatureSequence {
  CameraCalibration calibration;
  std::vector<FeatureFrame> frames;
  std::vector<GroundTruthPose> ground_truth;
  std::vector<double> extract_ms;    // CPU time by frame
  std::vector<int64_t> num_corners;  // by frame: candidates before the selection
};

// What makes the same images a sequence of its own.
struct Variation {
  bool is_mirrored = false;   // mono only: left and right are swapped, in images and truth
  int64_t quarter_turns = 0;  // clockwise, of the images: a phone upright, a camera upside down; not of a stereo pair
  bool is_reversed = false;   // the last image comes first, as long before the next as it came after it
  int64_t step = 1;           // only each step-th image
  double focal_error = 0.0;   // by which share the calibration's focal lengths are too long
  int64_t repeat = 0;         // each repeat-th image is the one before once more, as in videos of raised rate; 0: none
  double jitter_s = 0.0;      // times are wrong by up to so much, evenly
  int64_t dim = 1;            // so much less light, and so fewer gray values
  int64_t dirt = 0;           // seed of 15 dark spots on the lens; 0: none
  int64_t gaps = 0;           // seed of where images lack, as when USB is busy: a fifth, 2 to 8 in a row; 0: none
};

// Reads and extracts. Throws InputError as OpenSource does, or if there can be no such variation.
FeatureSequence ExtractSequence(const SourceOptions& source, const FeatureOptions& options,
                                const Variation& variation = {});

struct OfflineRun {
  explicit OfflineRun(const MapperOptions& options) : mapper(options) {}

  Mapper mapper;
  std::unique_ptr<LoopCloser> loop_closer;  // null: no loops are closed
  CorrectionDelays delays;
  std::vector<LoopResult> loops;  // by keyframe, without their corrections
  std::vector<PoseEstimate> poses;
  int num_lost = 0;
  int num_failures = 0;                                      // changes from tracked to lost
  int num_relocalized = 0;                                   // frames that a loop closer has placed
  Readout readout;                                           // as learned by the end (MapTracker)
  double depth_delay_s = 0.0;                                // likewise
  double right_delay_s = 0.0;                                // likewise
  std::vector<double> track_ms, map_ms, loop_ms, adjust_ms;  // CPU time by frame, by keyframe

  // Poses of tracked frames: as known at the time, and after all optimization.
  std::map<FrameId, Rigid3> Live() const;
  std::map<FrameId, Rigid3> Optimized() const;
};

// Tracks and maps the frames; `run` must be new.
void Play(const std::vector<FeatureFrame>& frames, const MapTrackerOptions& tracker_options, int64_t map_delay_frames,
          OfflineRun& run);

// How true the poses' own word on their errors is. Of tracked frames that are no keyframes, against their reference
// keyframe: e = the true pose relative to that keyframe, seen from the estimated one.
struct Consistency {
  int num_poses = 0;
  double nees_per_dof = 0.0;  // mean of e' covariance^-1 e / dof; 1 if the covariance is true
  double share_within = 0.0;  // of poses whose e the covariance holds with 95 %
  double velocity_rms = 0.0;  // m/s: of the velocity's error, against the mean over the steps before and after
};

// `with_scale`: mono, whose lengths are free. The estimates take the scale of the whole run, and each e its own (one
// degree of freedom less). nullopt if no pose can be compared.
std::optional<Consistency> MeasureConsistency(const OfflineRun& run, const std::vector<GroundTruthPose>& truth,
                                              bool with_scale);

// How steady the scale of the way is: s(t) = way that was estimated / true way, over kScaleWindow_s around t. Changes
// are ratios; RMS errors of single runs hide them, since an error at one place makes up for one at another.
struct ScaleChange {
  double greatest = 1.0;    // ratio, >= 1, of s at two times at most 10 s apart
  double greatest_s = 0.0;  // the later of the two, from the first frame on
  double typical = 1.0;     // exp of the RMS of log(s(t + 5 s) / s(t))
};
inline constexpr double kScaleWindow_s = 2.0;

// nullopt where the camera is tracked for less than a window, or does not move.
std::optional<ScaleChange> MeasureScale(const std::map<FrameId, Rigid3>& estimate,
                                        const std::vector<GroundTruthPose>& truth);

// RMS distance [m] of the positions from the true ones after the best alignment; nullopt if too few are known.
std::optional<double> RmsError(const std::map<FrameId, Rigid3>& estimate, const std::vector<GroundTruthPose>& truth,
                               bool with_scale);

}  // namespace tessera
