#include "mapping/lens_refiner.h"

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

constexpr size_t kMaxKeyframes = 50;  // that a look takes in
constexpr size_t kMinKeyframes = 20;
constexpr size_t kMinObservers = 3;   // of those, of a landmark
constexpr int64_t kMinInterval = 10;  // keyframes between looks; twice as many after each that finds no error
constexpr int64_t kMaxInterval = 80;
constexpr double kMinTurn_rad = 0.6;      // in all, of the keyframes
constexpr double kMinError = 0.005;       // of a focal length, to be worth a change
constexpr double kMinErrorLeft = 0.0025;  // likewise, of a calibration that is known to be wrong
constexpr double kMinSigmas = 5.0;        // and beyond doubt
constexpr double kMaxSigmasApart = 3.0;   // two looks

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

// The first pose is held, and how far from it the one is that stands at a quarter of the way: what is older than the
// window hangs on its beginning.
BundleProblem ProblemOf(const Map& map, const std::vector<KeyframeId>& keyframes, size_t max_landmarks) {
  const LocalWindow window{.inner = keyframes, .landmarks = LongestTracks(map, keyframes, max_landmarks)};
  BundleProblem problem = BuildLocalProblem(map, window, {});
  for (size_t i = 0; i < problem.poses.size(); ++i) problem.poses[i].is_fixed = i == 0;
  problem.scale_pose = static_cast<int>(keyframes.size() / 4);
  return problem;
}

bool IsError(const FocalEstimate& estimate, double min_error) {
  return std::abs(estimate.error) >= std::max(min_error, kMinSigmas * estimate.sigma);
}

}  // namespace

bool LensRefiner::Refine(KeyframeId next, const CameraCalibration& given, MapEditor& editor) {
  const Map& map = editor.map();
  error_ = FocalError(map.lens(), given);
  if (given.sensor != SensorType::kMono || next < next_look_ || map.FindKeyframe(map.answered()) == nullptr)
    return false;
  const std::vector<KeyframeId> keyframes = NewestKeyframes(map);
  next_look_ = {next.value + kMinInterval};
  if (keyframes.size() < kMinKeyframes || TurnOf(map, keyframes) < kMinTurn_rad) return false;
  const BundleProblem problem = ProblemOf(map, keyframes, max_landmarks_);
  LensEstimator estimator(problem);
  const std::optional<FocalEstimate> found = estimator.Focal();
  const bool is_error = found && IsError(*found, map.lens().is_known() ? kMinErrorLeft : kMinError);
  interval_ = is_error ? kMinInterval : std::clamp(2 * interval_, kMinInterval, kMaxInterval);
  next_look_ = {next.value + interval_};
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
  if (!is_plausible || !Change(*error, keyframes, editor)) return false;
  error_ = focal;
  return true;
}

bool LensRefiner::Change(const LensError& error, const std::vector<KeyframeId>& keyframes, MapEditor& editor) {
  BundleProblem problem = ProblemOf(editor.map(), keyframes, std::numeric_limits<size_t>::max());
  const LensCorrection lens = CorrectedBy(error, problem.calibration);
  problem = WithLensError(std::move(problem), error);
  const std::optional<BundleResult> adjusted = AdjustBundle(problem, GlobalBundleOptions());
  if (!adjusted) return false;
  before_.reset();
  editor.ChangeLens(lens);
  WriteBack(problem, *adjusted, editor);
  return true;
}

}  // namespace tessera
