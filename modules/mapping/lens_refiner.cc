#include "mapping/lens_refiner.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "map/spanning_tree.h"
#include "optimization/local_adjustment.h"

namespace tessera {
namespace {

// What a look takes in. A pair of cameras needs fewer keyframes, and a third of the landmarks.
constexpr size_t kMaxKeyframes = 50;
constexpr size_t kMinKeyframes = 20, kMinKeyframesOfPair = 8;
constexpr size_t kMinObservers = 3;  // of those, of a landmark
constexpr size_t kLandmarksOfPair = 3;
constexpr double kMinTurn_rad = 0.6;  // of one camera, in all, of the keyframes
// Keyframes between looks; twice as many after each that finds no error.
constexpr int64_t kMinInterval = 10, kMinIntervalOfPair = 4;
constexpr int64_t kMaxInterval = 80;
// An error of a focal length that is worth a change, at first and of a calibration that is known to be wrong; beyond
// doubt; and how far apart two looks may be.
constexpr double kMinError = 0.005, kMinErrorLeft = 0.0025;
constexpr double kMinSigmas = 5.0;
constexpr double kMaxSigmasApart = 3.0;
// The same of right columns, where they are moved furthest. Right pairs reach 4.8 standard deviations, one with a
// rolling shutter 6.4; once it is known to be wrong, the best is best.
constexpr double kMinShift_px = 0.04, kMinShiftLeft_px = 0.02;
constexpr double kMinSigmasOfPair = 7.0, kMinSigmasLeftOfPair = 1.0;
constexpr double kLargeChange_px = 0.2;  // the costs are no parabola over more
// What calibrations are wrong by, as standard deviations: a turn of the right camera, and each number besides.
constexpr double kTurnSigma_px = 0.5, kShiftSigma_px = 0.25, kBendSigma_px = 0.1;

// The newest keyframes of the newest part of the map.
std::vector<KeyframeId> NewestKeyframes(const Map& map) {
  std::vector<KeyframeId> part = MapPartOf(map, map.answered());
  if (part.size() > kMaxKeyframes) part.erase(part.begin(), part.end() - static_cast<std::ptrdiff_t>(kMaxKeyframes));
  return part;
}

double TurnOf(const Map& map, const std::vector<KeyframeId>& keyframes) {
  double turn = 0.0;
  for (size_t i = 1; i < keyframes.size(); ++i) {
    turn +=
        map.FindKeyframe(keyframes[i - 1])
            ->world_from_camera.rotation.angularDistance(map.FindKeyframe(keyframes[i])->world_from_camera.rotation);
  }
  return turn;
}

// Landmarks that at least kMinObservers of the keyframes observe, by id: at most `max_num`, those of the longest
// tracks, which know most; of equally long ones those of lower id.
std::vector<LandmarkId> LongestTracks(const Map& map, const std::vector<KeyframeId>& keyframes, size_t max_num) {
  std::map<LandmarkId, size_t> num_observers;
  for (const KeyframeId id : keyframes) {
    for (const LandmarkId landmark : map.FindKeyframe(id)->landmarks) {
      if (landmark.valid()) ++num_observers[landmark];
    }
  }
  std::vector<LandmarkId> tracks;
  for (const auto& [id, num] : num_observers) {
    if (num >= kMinObservers) tracks.push_back(id);
  }
  if (tracks.size() <= max_num) return tracks;
  std::ranges::stable_sort(tracks, std::greater<>(), [&](LandmarkId id) { return num_observers.at(id); });
  tracks.resize(max_num);
  std::ranges::sort(tracks);
  return tracks;
}

// The first pose is held, and with one camera how far from it the one is that stands at a quarter of the way: what is
// older than the window hangs on its beginning.
BundleProblem ProblemOf(const Map& map, const std::vector<KeyframeId>& keyframes, size_t max_landmarks) {
  const LocalWindow window{.inner = keyframes, .landmarks = LongestTracks(map, keyframes, max_landmarks)};
  BundleProblem problem = BuildLocalProblem(map, window, {});
  for (size_t i = 0; i < problem.poses.size(); ++i) problem.poses[i].is_fixed = i == 0;
  if (!problem.has_right()) problem.scale_pose = static_cast<int>(keyframes.size() / 4);
  return problem;
}

bool IsError(const FocalEstimate& estimate, double min_error) {
  return std::abs(estimate.error) >= std::max(min_error, kMinSigmas * estimate.sigma);
}

Eigen::Vector4d NumbersOf(const RightShift& shift) {
  return {shift.center_px, shift.across_px, shift.down_px, shift.bend_px};
}
RightShift ShiftOf(const Eigen::Vector4d& numbers) { return {numbers.x(), numbers.y(), numbers.z(), numbers.w()}; }

// Over the image, px, about: at its corners.
double WidestShift(const Eigen::Vector4d& shift, CameraCalibration camera) {
  camera.right_shift = ShiftOf(shift);
  double widest_px = 0.0;
  for (const double x_px : {0.0, camera.width_px - 1.0}) {
    for (const double y_px : {0.0, camera.height_px - 1.0}) {
      widest_px = std::max(widest_px, std::abs(RightShiftAt(camera, {x_px, y_px})));
    }
  }
  return widest_px;
}

// What is usual, about `shift`: one camera squints, and each number is a little wrong besides. A turn by an angle a
// about y shows what it showed at x, in units of the focal length, by a (1 + x^2) beside.
RightShiftEquations UsualShift(const Eigen::Vector4d& shift, const CameraCalibration& camera) {
  const double half_width = 0.5 * camera.width_px / camera.fx_px;
  const Eigen::Vector4d by_squint(1.0, 0.0, 0.0, half_width * half_width);
  const Eigen::Vector4d sigma(kShiftSigma_px, kShiftSigma_px, kTurnSigma_px, kBendSigma_px);
  Eigen::Matrix4d covariance = sigma.cwiseAbs2().asDiagonal();
  covariance += kTurnSigma_px * kTurnSigma_px * by_squint * by_squint.transpose();
  const Eigen::Matrix4d information = covariance.inverse();
  return {information, information * shift};
}

}  // namespace

bool LensRefiner::Refine(KeyframeId next, const CameraCalibration& given, MapEditor& editor) {
  const Map& map = editor.map();
  error_ = FocalError(map.lens(), given);
  if (given.sensor == SensorType::kRgbd || next < next_look_ || map.FindKeyframe(map.answered()) == nullptr)
    return false;
  const std::vector<KeyframeId> keyframes = NewestKeyframes(map);
  looked_ = next;
  const bool is_stereo = given.sensor == SensorType::kStereo;
  min_interval_ = is_stereo ? kMinIntervalOfPair : kMinInterval;
  next_look_ = {next.value + min_interval_};
  if (keyframes.size() < (is_stereo ? kMinKeyframesOfPair : kMinKeyframes)) return false;
  if (is_stereo) return RefineRightImage(given, keyframes, editor);
  return TurnOf(map, keyframes) >= kMinTurn_rad && RefineFocal(given, keyframes, editor);
}

bool LensRefiner::RefineFocal(const CameraCalibration& given, const std::vector<KeyframeId>& keyframes,
                              MapEditor& editor) {
  const Map& map = editor.map();
  const BundleProblem problem = ProblemOf(map, keyframes, max_landmarks_);
  LensEstimator estimator(problem);
  const std::optional<FocalEstimate> found = estimator.Focal();
  const bool is_error = found && IsError(*found, map.lens().is_known() ? kMinErrorLeft : kMinError);
  Plan(is_error);
  const std::optional<FocalEstimate> before = std::exchange(before_, is_error ? found : std::nullopt);
  if (!is_error || !before || std::abs(before->error - found->error) > kMaxSigmasApart * before->sigma) return false;
  // Beyond what a calibration can be wrong by, something else is: a distortion that was never looked at.
  const CameraCalibration current = WithLens(given, map.lens());
  const std::optional<LensError> error = estimator.Lens({error_, current.radial});
  if (!error) return false;
  const double total = FocalError(CorrectedBy({found->error, 0.0}, current), given);
  const double focal = FocalError(CorrectedBy(*error, current), given);
  const bool is_plausible = std::abs(total) <= kMaxFocalError && std::abs(focal) <= kMaxFocalError &&
                            std::abs(current.radial + error->radial) <= kMaxRadial;
  if (!is_plausible) doubt_ = total;
  BundleProblem all = ProblemOf(map, keyframes, std::numeric_limits<size_t>::max());
  const LensCorrection lens = CorrectedBy(*error, all.calibration);
  if (!is_plausible || !Change(WithLensError(std::move(all), *error), lens, editor)) return false;
  before_.reset();
  error_ = focal;
  return true;
}

// Looks overlap: one counts by the share of its keyframes that are new to it.
bool LensRefiner::RefineRightImage(const CameraCalibration& given, const std::vector<KeyframeId>& keyframes,
                                   MapEditor& editor) {
  const Map& map = editor.map();
  const CameraCalibration current = WithLens(given, map.lens());
  const std::optional<RightShiftEquations> found =
      EquationsOfRightShift(ProblemOf(map, keyframes, max_landmarks_ / kLandmarksOfPair));
  if (!found) return false;
  const Eigen::Vector4d known = NumbersOf(current.right_shift);
  if (!right_shift_) right_shift_ = UsualShift(known, given);
  const auto num_new = std::ranges::count_if(keyframes, [&](KeyframeId id) { return id > newest_looked_at_; });
  const double weight = static_cast<double>(num_new) / static_cast<double>(keyframes.size());
  RightShiftEquations equations = *right_shift_;
  equations.information += weight * found->information;
  equations.right_side += weight * (found->information * known + found->right_side);
  const Eigen::LLT<Eigen::Matrix4d> factors(equations.information);
  if (factors.info() != Eigen::Success) return false;
  right_shift_ = equations;
  newest_looked_at_ = keyframes.back();
  ++num_right_looks_;
  const Eigen::Vector4d total = factors.solve(equations.right_side);
  const Eigen::Vector4d error = total - known;
  const double sigmas = std::sqrt(error.dot(equations.information * error));
  const double error_px = WidestShift(error, given);
  const bool is_first = current.right_shift.is_zero();
  const bool is_error = is_first ? sigmas >= kMinSigmasOfPair && error_px >= kMinShift_px
                                 : sigmas >= kMinSigmasLeftOfPair && error_px >= kMinShiftLeft_px;
  const bool is_large = error_px > kLargeChange_px;
  Plan(is_error && (is_first || is_large));
  if (!is_error || (is_first && num_right_looks_ < 2)) return false;
  if (const double largest_px = total.cwiseAbs().maxCoeff(); largest_px > kMaxRightShift_px) {
    right_shift_doubt_px_ = largest_px;
    return false;
  }
  const BundleProblem all = ProblemOf(map, keyframes, std::numeric_limits<size_t>::max());
  const LensCorrection lens{given.fx_px, given.fy_px, 0.0, ShiftOf(total)};
  if (!Change(WithRightShift(all, ShiftOf(error)), lens, editor)) return false;
  // The parabola is one near the minimum only.
  if (is_large) {
    right_shift_ = UsualShift(total, given);
    newest_looked_at_ = {};
  }
  return true;
}

void LensRefiner::Plan(bool is_error) {
  interval_ = is_error ? min_interval_ : std::clamp(2 * interval_, min_interval_, kMaxInterval);
  next_look_ = {looked_.value + interval_};
}

bool LensRefiner::Change(const BundleProblem& problem, const LensCorrection& lens, MapEditor& editor) {
  const std::optional<BundleResult> adjusted = AdjustBundle(problem, GlobalBundleOptions());
  if (!adjusted) return false;
  editor.ChangeLens(lens);
  WriteBack(problem, *adjusted, editor);
  return true;
}

}  // namespace tessera
