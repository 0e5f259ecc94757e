#include "benchmarks/offline_run.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include "core/errors.h"
#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "geometry/alignment.h"
#include "optimization/global_adjustment.h"

namespace tessera {
namespace {

// CPU time, which a busy machine changes less than wall time.
template <class Step>
auto Measure(std::vector<double>& ms, Step step) {
  const std::clock_t begin = std::clock();
  auto result = step();
  ms.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  return result;
}

FeatureFrame ExtractFrame(const CameraFrame& frame, const CameraCalibration& calibration, const FeatureOptions& options,
                          Extractor& extractor, int64_t* num_corners) {
  std::vector<TileFeatures> tiles;
  for (const TileJob& job : CutFrame(frame, calibration, 0, TileGrid{1, 1}, kMaxLevels, options)) {
    tiles.push_back(extractor.Extract(job));
  }
  *num_corners = 0;
  for (const TileFeatures& tile : tiles) *num_corners += static_cast<int64_t>(tile.candidates.size());
  return SelectFeatures(tiles).value().features;
}

void MirrorImage(GrayImage& image) {
  for (int y = 0; y < image.height; ++y) std::reverse(image.row(y), image.row(y) + image.width);
}

// With S = diag(-1, 1, 1): a mirrored camera stands at S R S, S t.
Rigid3 Mirrored(const Rigid3& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return {Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z()), {-t.x(), t.y(), t.z()}};
}

// From 0 to 1, evenly.
double Draw(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

void Dim(GrayImage& image, int64_t times) {
  for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>((pixel + times / 2) / times);
}

// Dark spots out of focus, as drops or mud on the lens, where they stay.
class Dirt {
 public:
  explicit Dirt(int64_t seed) : random_(static_cast<uint64_t>(seed)) {}

  void CastOn(GrayImage& image) {
    if (shade_.empty()) Spill(image.width, image.height);
    for (size_t i = 0; i < shade_.size(); ++i) {
      image.pixels[i] = static_cast<uint8_t>(image.pixels[i] + shade_[i] * (kColor - image.pixels[i]));
    }
  }

 private:
  static constexpr float kColor = 40.0F, kOpacity = 0.9F;

  void Spill(int width_px, int height_px) {
    shade_.assign(static_cast<size_t>(width_px) * static_cast<size_t>(height_px), 0.0F);
    constexpr int kNumSpots = 15;
    for (int spot = 0; spot < kNumSpots; ++spot) {
      const double x_px = width_px * Draw(random_);
      const double y_px = height_px * Draw(random_);
      const double radius_px = 0.05 * height_px * (0.5 + Draw(random_));
      for (int y = 0; y < height_px; ++y) {
        for (int x = 0; x < width_px; ++x) {
          const double inside = (radius_px - std::hypot(x - x_px, y - y_px)) / (0.3 * radius_px);
          float& shade = shade_[static_cast<size_t>(y) * static_cast<size_t>(width_px) + static_cast<size_t>(x)];
          shade = std::max(shade, kOpacity * static_cast<float>(std::clamp(inside, 0.0, 1.0)));
        }
      }
    }
  }

  std::mt19937_64 random_;
  std::vector<float> shade_;
};

// A quarter turn clockwise.
template <class Pixel>
Image<Pixel> Turned(const Image<Pixel>& image) {
  Image<Pixel> turned(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) turned.row(x)[image.height - 1 - y] = image.row(y)[x];
  }
  return turned;
}

CameraCalibration Turned(CameraCalibration camera) {
  std::swap(camera.width_px, camera.height_px);
  std::swap(camera.fx_px, camera.fy_px);
  std::swap(camera.cx_px, camera.cy_px);
  camera.cx_px = camera.width_px - 1 - camera.cx_px;
  return camera;
}

// What was on the right is below then.
Rigid3 Turned(const Rigid3& world_from_camera) {
  return {world_from_camera.rotation * ExpSO3(Eigen::Vector3d(0.0, 0.0, -0.5 * std::numbers::pi)),
          world_from_camera.translation};
}

// Numbers the frames from 0 on, in their order. Truth of other frames goes.
void Renumber(FeatureSequence& sequence) {
  std::map<FrameId, FrameId> number_of;
  for (FeatureFrame& frame : sequence.frames) {
    const FrameId number{static_cast<int64_t>(number_of.size())};
    number_of[frame.frame] = number;
    frame.frame = number;
  }
  std::erase_if(sequence.ground_truth, [&](const GroundTruthPose& pose) { return !number_of.contains(pose.frame); });
  for (GroundTruthPose& pose : sequence.ground_truth) pose.frame = number_of.at(pose.frame);
}

// Which images lack, by Variation::gaps. None of the first twenty: a run needs a start.
class Gaps {
 public:
  explicit Gaps(int64_t seed) : has_any_(seed != 0), random_(static_cast<uint64_t>(seed)) {}

  bool Contains(int64_t image) {
    if (!has_any_ || image < 20) return false;
    if (num_left_ == 0) num_left_ = random_() % 20 == 0 ? 3 + static_cast<int64_t>(random_() % 7) : 1;
    return --num_left_ > 0;
  }

 private:
  bool has_any_;
  std::mt19937_64 random_;
  int64_t num_left_ = 0;  // of the present gap, with the image that ends it
};

// In place of each `every`-th image stands the one before it, and so does the truth.
void RepeatImages(FeatureSequence& sequence, int64_t every) {
  std::map<FrameId, FrameId> shows;
  for (size_t i = 1; i < sequence.frames.size(); ++i) {
    if (static_cast<int64_t>(i) % every != 0) continue;
    FeatureFrame repeated = sequence.frames[i - 1];
    repeated.frame = sequence.frames[i].frame;
    repeated.utime_us = sequence.frames[i].utime_us;
    shows[repeated.frame] = sequence.frames[i - 1].frame;
    sequence.frames[i] = std::move(repeated);
  }
  std::map<FrameId, Rigid3> truth;
  for (const GroundTruthPose& pose : sequence.ground_truth) truth[pose.frame] = pose.world_from_camera;
  for (GroundTruthPose& pose : sequence.ground_truth) {
    const auto shown = shows.find(pose.frame);
    if (shown != shows.end() && truth.contains(shown->second)) pose.world_from_camera = truth.at(shown->second);
  }
}

// The truth stays that of the images.
void Jitter(FeatureSequence& sequence, double jitter_s) {
  std::mt19937_64 random(1);
  std::map<FrameId, int64_t> utime_us;
  int64_t last_us = std::numeric_limits<int64_t>::min();
  for (FeatureFrame& frame : sequence.frames) {
    const double share = 2.0 * Draw(random) - 1.0;
    frame.utime_us = std::max(last_us + 1, frame.utime_us + static_cast<int64_t>(1e6 * jitter_s * share));
    utime_us[frame.frame] = last_us = frame.utime_us;
  }
  for (GroundTruthPose& pose : sequence.ground_truth) {
    const auto frame = utime_us.find(pose.frame);
    if (frame != utime_us.end()) pose.utime_us = frame->second;
  }
}

// The last frame comes first, at the time of the first.
void ReverseTime(FeatureSequence& sequence) {
  if (sequence.frames.empty()) return;
  const int64_t first_and_last_us = sequence.frames.front().utime_us + sequence.frames.back().utime_us;
  for (FeatureFrame& frame : sequence.frames) frame.utime_us = first_and_last_us - frame.utime_us;
  for (GroundTruthPose& pose : sequence.ground_truth) pose.utime_us = first_and_last_us - pose.utime_us;
  std::ranges::reverse(sequence.frames);
  std::ranges::reverse(sequence.ground_truth);
  std::ranges::reverse(sequence.extract_ms);
  std::ranges::reverse(sequence.num_corners);
}

}  // namespace

FeatureSequence ExtractSequence(const SourceOptions& options, const FeatureOptions& feature_options,
                                const Variation& variation) {
  const auto source = OpenSource(options);
  FeatureSequence sequence{source->calibration(), {}, source->ground_truth(), {}, {}};
  if (variation.step < 1) throw InputError("step must be at least 1");
  if (variation.is_mirrored) {
    if (options.sensor != SensorType::kMono) throw InputError("only mono sequences can be mirrored");
    sequence.calibration.cx_px = sequence.calibration.width_px - 1 - sequence.calibration.cx_px;
    for (GroundTruthPose& pose : sequence.ground_truth) pose.world_from_camera = Mirrored(pose.world_from_camera);
  }
  if (variation.quarter_turns < 0) throw InputError("a camera turns by 0 quarter turns or more");
  if (variation.quarter_turns > 0 && options.sensor == SensorType::kStereo) {
    throw InputError("stereo pairs stand side by side, they can't be turned");
  }
  for (int64_t turn = 0; turn < variation.quarter_turns; ++turn) {
    sequence.calibration = Turned(sequence.calibration);
    for (GroundTruthPose& pose : sequence.ground_truth) pose.world_from_camera = Turned(pose.world_from_camera);
  }
  sequence.calibration.fx_px *= 1.0 + variation.focal_error;
  sequence.calibration.fy_px *= 1.0 + variation.focal_error;
  Extractor extractor;
  Gaps gaps(variation.gaps);
  Dirt dirt(variation.dirt);
  for (int64_t i = 0; auto frame = source->Next(); ++i) {
    if (i % variation.step != 0 || gaps.Contains(i)) continue;
    if (variation.is_mirrored) MirrorImage(frame->left);
    if (variation.dirt != 0) dirt.CastOn(frame->left);
    if (variation.dim > 1) {
      Dim(frame->left, variation.dim);
      Dim(frame->right, variation.dim);
    }
    for (int64_t turn = 0; turn < variation.quarter_turns; ++turn) {
      frame->left = Turned(frame->left);
      if (options.sensor == SensorType::kRgbd) frame->depth = Turned(frame->depth);
    }
    int64_t& num_corners = sequence.num_corners.emplace_back();
    sequence.frames.push_back(Measure(sequence.extract_ms, [&] {
      return ExtractFrame(*frame, sequence.calibration, feature_options, extractor, &num_corners);
    }));
  }
  if (variation.repeat > 0) RepeatImages(sequence, variation.repeat);
  if (variation.jitter_s > 0.0) Jitter(sequence, variation.jitter_s);
  if (variation.is_reversed) ReverseTime(sequence);
  if (variation.is_reversed || variation.step > 1 || variation.gaps != 0) Renumber(sequence);
  return sequence;
}

std::map<FrameId, Rigid3> OfflineRun::Live() const {
  std::map<FrameId, Rigid3> live;
  for (const PoseEstimate& pose : poses) {
    if (pose.state == TrackingState::kTracked) live[pose.frame] = pose.world_from_camera;
  }
  return live;
}

std::map<FrameId, Rigid3> OfflineRun::Optimized() const {
  std::map<FrameId, Rigid3> optimized;
  for (const PoseEstimate& pose : poses) {
    if (pose.state != TrackingState::kTracked) continue;
    const auto reference = mapper.removed_keyframes().Find(mapper.map(), pose.reference_keyframe);
    if (reference) optimized[pose.frame] = (*reference * pose.reference_from_camera).Pose();
  }
  return optimized;
}

namespace {

// The mapper with the loop closer and the global adjuster behind it, in logical time.
class Mapping {
 public:
  explicit Mapping(OfflineRun& run) : run_(run), schedule_(run.delays) {}

  std::shared_ptr<const MapDelta> Process(const KeyframeObservation& keyframe) {
    const DueCorrections due = run_.loop_closer ? schedule_.Take(keyframe.id) : DueCorrections{};
    const auto delta =
        Measure(run_.map_ms, [&] { return std::make_shared<const MapDelta>(run_.mapper.Process(keyframe, due)); });
    Follow(*delta);
    if (run_.loop_closer) {
      LoopResult result = Measure(run_.loop_ms, [&] { return run_.loop_closer->FindLoop(keyframe.id); });
      schedule_.Receive(result);
      if (result.matched.valid()) {
        std::fprintf(stderr, "keyframe %ld sees keyframe %ld again: %zu points, scale %.4f\n",
                     static_cast<long>(result.answers.value), static_cast<long>(result.matched.value),
                     result.seen.size(), result.matched_from_current.scale);
      }
      result.corrections.clear();
      run_.loops.push_back(std::move(result));
    }
    return delta;
  }

  void Finish() {
    if (!run_.loop_closer || run_.loops.empty()) return;
    while (auto delta = run_.mapper.Finish(schedule_.TakeAll(run_.loops.back().answers))) Follow(*delta);
  }

 private:
  void Follow(const MapDelta& delta) {
    if (!run_.loop_closer) return;
    ThrowIfFailed<InputError>(run_.loop_closer->ApplyDelta(delta));
    if (!delta.asks_adjustment) return;
    schedule_.Ask(delta.answers, delta.number);
    schedule_.Receive(Measure(run_.adjust_ms,
                              [&] { return AdjustGlobally(run_.mapper.map(), delta.answers, GlobalBundleOptions()); }));
  }

  OfflineRun& run_;
  CorrectionSchedule schedule_;
};

// A frame that can't be placed waits for the answer of a loop closer that has seen all keyframes so far.
MapTrackingResult TrackOrAsk(MapTracker& tracker, const FeatureFrame& features, OfflineRun& run) {
  MapTrackingResult result = tracker.Track(features, nullptr, run.loop_closer != nullptr);
  if (!result.asks_relocalization) return result;
  const RelocalizationAnswer answer =
      run.loop_closer->Relocalize({tracker.own_body().Without(features), tracker.last_keyframe()});
  run.num_relocalized += answer.reference.valid() ? 1 : 0;
  return tracker.Track(features, &answer);
}

}  // namespace

void Play(const std::vector<FeatureFrame>& frames, const MapTrackerOptions& tracker_options, int64_t map_delay_frames,
          OfflineRun& run) {
  MapTracker tracker(tracker_options);
  LogicalTime time(map_delay_frames);
  Mapping mapping(run);
  bool was_lost = false;
  int64_t previous_us = frames.empty() ? 0 : frames.front().utime_us;
  for (const FeatureFrame& features : frames) {
    const int64_t interval_us = features.utime_us - std::exchange(previous_us, features.utime_us);
    const MapTrackingResult result = Measure(run.track_ms, [&] {
      for (const auto& delta : time.TakeDeltas(features.frame)) {
        ThrowIfFailed<InputError>(tracker.ApplyDelta(*delta));
      }
      return TrackOrAsk(tracker, features, run);
    });
    run.poses.push_back(result.pose);
    run.readout = tracker.times().readout();
    run.depth_delay_s = tracker.times().depth_delay_s();
    run.right_delay_s = tracker.times().right_delay_s();
    const bool is_lost = result.pose.state == TrackingState::kLost;
    run.num_lost += is_lost ? 1 : 0;
    run.num_failures += is_lost && !was_lost ? 1 : 0;
    was_lost = is_lost;
    for (const KeyframeObservation& keyframe : result.keyframes) {
      time.KeyframeSent(keyframe.id, features.frame, interval_us);
      time.Receive(mapping.Process(keyframe));
    }
  }
  mapping.Finish();
}

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// The camera's velocity in its own axes: the mean of those over the steps before and after.
std::optional<Eigen::Vector3d> TrueVelocity(const std::map<FrameId, GroundTruthPose>& truth, FrameId frame) {
  const auto before = truth.find({frame.value - 1}), at = truth.find(frame), after = truth.find({frame.value + 1});
  if (before == truth.end() || at == truth.end() || after == truth.end()) return std::nullopt;
  const auto per_s = [](const GroundTruthPose& from, const GroundTruthPose& to) -> Eigen::Vector3d {
    return (to.world_from_camera.translation - from.world_from_camera.translation) /
           (1e-6 * static_cast<double>(to.utime_us - from.utime_us));
  };
  return at->second.world_from_camera.rotation.inverse() *
         (0.5 * (per_s(before->second, at->second) + per_s(at->second, after->second)));
}

}  // namespace

std::optional<Consistency> MeasureConsistency(const OfflineRun& run, const std::vector<GroundTruthPose>& truth,
                                              bool with_scale) {
  std::map<FrameId, GroundTruthPose> truth_of;
  std::vector<Eigen::Vector3d> estimated_places, true_places;
  for (const GroundTruthPose& pose : truth) truth_of[pose.frame] = pose;
  std::map<KeyframeId, Rigid3> true_keyframes;
  for (const PoseEstimate& pose : run.poses) {
    if (pose.state != TrackingState::kTracked || !truth_of.contains(pose.frame)) continue;
    estimated_places.push_back(pose.world_from_camera.translation);
    true_places.push_back(truth_of[pose.frame].world_from_camera.translation);
    if (pose.is_keyframe) true_keyframes[pose.reference_keyframe] = truth_of[pose.frame].world_from_camera;
  }
  const std::optional<Alignment> alignment = AlignPoints(estimated_places, true_places, with_scale);
  if (!alignment) return std::nullopt;
  const double scale = alignment->b_from_a.scale;
  const int num_dof = with_scale ? 5 : 6;
  Consistency sum;
  int num_velocities = 0;
  for (const PoseEstimate& pose : run.poses) {
    const auto keyframe = true_keyframes.find(pose.reference_keyframe);
    if (pose.is_keyframe || !pose.body.has_covariance || keyframe == true_keyframes.end()) continue;
    Rigid3 estimate = pose.reference_from_camera;
    estimate.translation *= scale;
    const Rigid3 true_pose = keyframe->second.Inverse() * truth_of[pose.frame].world_from_camera;
    const Rigid3 difference = estimate.Inverse() * true_pose;
    Vector6d e, unit = Vector6d::Ones();
    e << difference.translation, LogSO3(difference.rotation);
    unit.head<3>() *= scale;
    const Eigen::Vector3d way = estimate.rotation.inverse() * estimate.translation;
    const double nees_per_dof = ErrorByCovariance(e, unit.asDiagonal() * pose.body.covariance * unit.asDiagonal(),
                                                  with_scale ? std::optional<Eigen::Vector3d>(way) : std::nullopt);
    ++sum.num_poses;
    sum.nees_per_dof += nees_per_dof;
    sum.share_within += num_dof * nees_per_dof < (with_scale ? 11.070 : 12.592) ? 1.0 : 0.0;  // 95 % of chi-square
    const std::optional<Eigen::Vector3d> velocity = TrueVelocity(truth_of, pose.frame);
    if (!velocity || !pose.body.has_motion) continue;
    sum.velocity_rms += (scale * pose.body.motion.velocity - *velocity).squaredNorm();
    ++num_velocities;
  }
  if (sum.num_poses == 0) return std::nullopt;
  sum.nees_per_dof /= sum.num_poses;
  sum.share_within /= sum.num_poses;
  sum.velocity_rms = std::sqrt(sum.velocity_rms / std::max(1, num_velocities));
  return sum;
}

namespace {

constexpr double kMinWay_m = 0.1;  // of a window: a camera that stands still shows no scale

struct ScaleAt {
  double time_s;
  double log_scale;
};

// Of each window that begins with a tracked frame.
std::vector<ScaleAt> ScalesOf(const std::map<FrameId, Rigid3>& estimate, const std::vector<GroundTruthPose>& truth) {
  struct Place {
    double time_s, way, true_way;  // since the first one
  };
  std::vector<Place> places;
  const Rigid3 *last = nullptr, *true_last = nullptr;
  for (const GroundTruthPose& pose : truth) {
    const auto found = estimate.find(pose.frame);
    if (found == estimate.end()) continue;
    Place place{1e-6 * static_cast<double>(pose.utime_us - truth.front().utime_us), 0.0, 0.0};
    if (last != nullptr) {
      place.way = places.back().way + (found->second.translation - last->translation).norm();
      place.true_way = places.back().true_way + (pose.world_from_camera.translation - true_last->translation).norm();
    }
    places.push_back(place);
    last = &found->second;
    true_last = &pose.world_from_camera;
  }
  std::vector<ScaleAt> scales;
  for (auto begin = places.begin(), end = begin; begin != places.end(); ++begin) {
    end = std::find_if(end, places.end(), [&](const Place& p) { return p.time_s >= begin->time_s + kScaleWindow_s; });
    if (end == places.end()) break;
    const double true_way = end->true_way - begin->true_way;
    if (true_way < kMinWay_m) continue;
    scales.push_back({0.5 * (begin->time_s + end->time_s), std::log((end->way - begin->way) / true_way)});
  }
  return scales;
}

}  // namespace

std::optional<ScaleChange> MeasureScale(const std::map<FrameId, Rigid3>& estimate,
                                        const std::vector<GroundTruthPose>& truth) {
  const std::vector<ScaleAt> scales = ScalesOf(estimate, truth);
  if (scales.empty()) return std::nullopt;
  ScaleChange change;
  double squares = 0.0;
  int num = 0;
  for (auto from = scales.begin(), after = from; from != scales.end(); ++from) {
    for (auto to = from; to != scales.end() && to->time_s <= from->time_s + 10.0; ++to) {
      const double ratio = std::exp(std::abs(to->log_scale - from->log_scale));
      if (ratio > change.greatest) change = {ratio, to->time_s, 1.0};
    }
    after = std::find_if(after, scales.end(), [&](const ScaleAt& at) { return at.time_s >= from->time_s + 5.0; });
    if (after == scales.end()) continue;
    squares += (after->log_scale - from->log_scale) * (after->log_scale - from->log_scale);
    ++num;
  }
  change.typical = std::exp(std::sqrt(squares / std::max(1, num)));
  return change;
}

std::optional<double> RmsError(const std::map<FrameId, Rigid3>& estimate, const std::vector<GroundTruthPose>& truth,
                               bool with_scale) {
  std::vector<Eigen::Vector3d> a, b;
  for (const GroundTruthPose& pose : truth) {
    const auto found = estimate.find(pose.frame);
    if (found == estimate.end()) continue;
    a.push_back(found->second.translation);
    b.push_back(pose.world_from_camera.translation);
  }
  const std::optional<Alignment> alignment = AlignPoints(a, b, with_scale);
  return alignment ? std::optional(alignment->rms) : std::nullopt;
}

}  // namespace tessera
