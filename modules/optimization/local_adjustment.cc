#include "optimization/local_adjustment.h"

#include <algorithm>
#include <set>
#include <utility>

#include "measurement/landmark_view.h"

namespace tessera {
namespace {

constexpr size_t kMinConfirmed = 50;  // landmarks of a window
constexpr double kNoInformation = 1e-6;
constexpr double kMinKept = 0.5;

void AddPoses(const Map& map, const LocalWindow& window, bool is_double, BundleProblem& problem) {
  const auto add = [&](KeyframeId id, bool is_fixed) {
    problem.poses.push_back({id, map.FindKeyframe(id)->world_from_camera.Inverse(), is_fixed});
  };
  for (const KeyframeId id : window.inner) {
    add(id, !map.FindKeyframe(id)->parent.valid());
  }
  for (const KeyframeId id : window.outer) {
    add(id, !is_double || id == window.outer.front());
  }
  if (problem.num_fixed_poses() == 0) problem.poses.front().is_fixed = true;
}

// The observations of the first `num_observers` poses; landmarks that have fewer than two are left out.
void AddLandmarks(const Map& map, const std::vector<LandmarkId>& landmarks, size_t num_observers,
                  BundleProblem& problem) {
  std::vector<int> pose_of(static_cast<size_t>(map.keyframes().end_id()), -1);  // by keyframe; -1: none of them
  std::vector<const Keyframe*> observers(num_observers);
  for (size_t i = 0; i < num_observers; ++i) {
    pose_of[static_cast<size_t>(problem.poses[i].id.value)] = static_cast<int>(i);
    observers[i] = map.FindKeyframe(problem.poses[i].id);
  }
  for (const LandmarkId id : landmarks) {
    const ObservedLandmark& landmark = *map.landmarks().Find(id);
    const int point = static_cast<int>(problem.points.size());
    const size_t num_before = problem.observations.size();
    for (const Observation& observation : landmark.observations) {
      const int pose = pose_of[static_cast<size_t>(observation.keyframe.value)];
      if (pose < 0) continue;
      const Keyframe& observer = *observers[Index(pose)];
      problem.observations.push_back(
          {pose, point,
           SeenAt(*observer.features, observation.keypoint, landmark, observer.world_from_camera.translation)});
    }
    if (problem.observations.size() - num_before < 2) {
      problem.observations.resize(num_before);
    } else {
      problem.points.push_back({id, landmark.position_in_world});
    }
  }
}

// Index of the keyframe among the poses, in whatever order; their number: not in the window.
size_t FindPose(const BundleProblem& problem, KeyframeId id) {
  const auto found =
      std::find_if(problem.poses.begin(), problem.poses.end(), [&](const BundlePose& pose) { return pose.id == id; });
  return static_cast<size_t>(found - problem.poses.begin());
}

// Constraints of the double window. Two outer poses have one constraint, whichever of them chose the other.
void AddConstraints(const Map& map, size_t num_inner, BundleProblem& problem) {
  const double rad_per_px = KeypointSigmaPx(problem.calibration.sensor) / problem.calibration.fx_px;
  std::set<std::pair<size_t, size_t>> constrained;
  for (size_t i = num_inner; i < problem.poses.size(); ++i) {
    const Keyframe& keyframe = *map.FindKeyframe(problem.poses[i].id);
    const double depth = MedianDepth(map, keyframe);
    int num_constraints = 0;
    for (const KeyframeId id : map.Covisible(problem.poses[i].id, static_cast<int>(keyframe.covisible.size()))) {
      const size_t other = FindPose(problem, id);
      if (other == problem.poses.size()) continue;
      if (num_constraints++ == kMaxConstraints) break;
      if (!constrained.insert(std::minmax(i, other)).second) continue;
      RelativePoseConstraint constraint;
      constraint.from = static_cast<int>(i);
      constraint.to = static_cast<int>(other);
      constraint.to_from_from = problem.poses[other].camera_from_world * problem.poses[i].camera_from_world.Inverse();
      const double num_shared = map.NumShared(problem.poses[i].id, id);
      constraint.information *= num_shared / (rad_per_px * rad_per_px);
      constraint.information.topLeftCorner<3, 3>() /= depth * depth;
      problem.constraints.push_back(constraint);
    }
  }
}

// Nothing is expected of the rotation.
void AddMotions(const Map& map, const KeyframeMotions& motions, BundleProblem& problem) {
  const auto num_poses = static_cast<int>(problem.poses.size());
  for (int to = 0; to < num_poses; ++to) {
    const auto motion = motions.find(problem.poses[Index(to)].id);
    const int from =
        motion != motions.end() ? static_cast<int>(FindPose(problem, motion->second.reference)) : num_poses;
    if (from == num_poses || (problem.poses[Index(from)].is_fixed && problem.poses[Index(to)].is_fixed)) continue;
    const double scale = map.FindKeyframe(motion->second.reference)->scale;
    const Rigid3 to_from_from =
        problem.poses[Index(to)].camera_from_world * problem.poses[Index(from)].camera_from_world.Inverse();
    const Eigen::Matrix3d rotation = to_from_from.rotation.toRotationMatrix();
    const MotionPrior& expected = motion->second.expected;
    RelativePoseConstraint constraint{from, to, {to_from_from.rotation, {}}};
    constraint.to_from_from.translation = -scale * (rotation * expected.position_in_reference);
    constraint.information *= kNoInformation;
    constraint.information.topLeftCorner<3, 3>() =
        rotation * expected.information * rotation.transpose() / (scale * scale);
    problem.constraints.push_back(constraint);
  }
}

// Mono with a single fixed pose: the free pose of the lowest id keeps its distance.
int ScalePose(const BundleProblem& problem) {
  if (problem.num_fixed_poses() > 1 || problem.has_right()) return -1;
  int best = -1;
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    const BundlePose& pose = problem.poses[i];
    if (!pose.is_fixed && (best < 0 || pose.id < problem.poses[static_cast<size_t>(best)].id)) {
      best = static_cast<int>(i);
    }
  }
  return best;
}

bool IsConfirmed(const Map& map, LandmarkId id, size_t num_confirming) {
  const std::span<const Observation> observations = map.ObservationsOf(id);
  return observations.size() >= num_confirming ||
         std::any_of(observations.begin(), observations.end(), [&](const Observation& seen) {
           return SeenAt(*map.FindKeyframe(seen.keyframe)->features, seen.keypoint).has_right();
         });
}

// Takes the landmarks out that are not confirmed, unless too few would be left.
std::vector<LandmarkId> TakeUnconfirmed(const Map& map, size_t num_confirming, std::vector<LandmarkId>& landmarks) {
  std::vector<LandmarkId> confirmed, unconfirmed;
  for (const LandmarkId id : landmarks) (IsConfirmed(map, id, num_confirming) ? confirmed : unconfirmed).push_back(id);
  if (confirmed.size() < kMinConfirmed) return {};
  landmarks = std::move(confirmed);
  return unconfirmed;
}

// The landmarks by themselves: all poses of the window are fixed where they are now.
BundleProblem BuildPointProblem(const Map& map, const BundleProblem& window, const std::vector<LandmarkId>& landmarks) {
  BundleProblem problem;
  problem.calibration = window.calibration;
  problem.baseline_m = window.baseline_m;
  for (const BundlePose& pose : window.poses) {
    problem.poses.push_back({pose.id, map.FindKeyframe(pose.id)->world_from_camera.Inverse(), true});
  }
  AddLandmarks(map, landmarks, problem.poses.size(), problem);
  return problem;
}

// Whether every keyframe that moved keeps kMinKept of its observations. One that hangs by few landmarks, hardly known
// in depth, can lose them one by one on its way to a place where robust costs no longer see them.
bool IsCredible(const BundleProblem& problem, const BundleResult& result) {
  std::vector<int> num_seen(problem.poses.size()), num_kept(problem.poses.size());
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const size_t pose = Index(problem.observations[i].pose);
    ++num_seen[pose];
    num_kept[pose] += result.is_inlier[i] ? 1 : 0;
  }
  for (size_t pose = 0; pose < problem.poses.size(); ++pose) {
    if (!problem.poses[pose].is_fixed && num_kept[pose] < kMinKept * num_seen[pose]) return false;
  }
  return true;
}

// Landmarks that only keyframe `id` observes move with it.
void MoveOwnLandmarks(KeyframeId id, const Rigid3& world_from_camera, MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const Rigid3 moved_from_old = world_from_camera * keyframe.world_from_camera.Inverse();
  for (const LandmarkId landmark_id : keyframe.landmarks) {
    if (!landmark_id.valid() || map.ObservationsOf(landmark_id).size() != 1) continue;
    Landmark landmark = *map.FindLandmark(landmark_id);
    landmark.position_in_world = moved_from_old * landmark.position_in_world;
    editor.ChangeLandmark(landmark_id, landmark);
  }
}

}  // namespace

BundleProblem BuildLocalProblem(const Map& map, const LocalWindow& window, const LocalWindowOptions& options,
                                const KeyframeMotions& motions) {
  BundleProblem problem;
  problem.calibration = map.FindKeyframe(window.inner.front())->features->calibration;
  problem.baseline_m = Baseline(problem.calibration);
  AddPoses(map, window, options.is_double, problem);
  AddLandmarks(map, window.landmarks, options.is_double ? window.inner.size() : problem.poses.size(), problem);
  if (options.is_double) AddConstraints(map, window.inner.size(), problem);
  problem.scale_pose = problem.constraints.empty() ? ScalePose(problem) : -1;
  AddMotions(map, motions, problem);
  return problem;
}

void WriteBack(const BundleProblem& problem, const BundleResult& result, MapEditor& editor) {
  const Map& map = editor.map();
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    if (problem.poses[i].is_fixed) continue;
    const Rigid3 world_from_camera = result.camera_from_world[i].Inverse();
    MoveOwnLandmarks(problem.poses[i].id, world_from_camera, editor);
    editor.MoveKeyframe(problem.poses[i].id, world_from_camera);
  }
  for (size_t i = 0; i < problem.points.size(); ++i) {
    Landmark landmark = *map.FindLandmark(problem.points[i].id);
    landmark.position_in_world = result.positions_in_world[i];
    editor.ChangeLandmark(problem.points[i].id, landmark);
  }
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    if (result.is_inlier[i]) continue;
    const LandmarkId landmark = problem.points[static_cast<size_t>(problem.observations[i].point)].id;
    const KeyframeId keyframe = problem.poses[static_cast<size_t>(problem.observations[i].pose)].id;
    const std::span<const Observation> observations = map.ObservationsOf(landmark);
    const auto seen = std::find_if(observations.begin(), observations.end(),
                                   [&](const Observation& o) { return o.keyframe == keyframe; });
    if (seen != observations.end()) editor.RemoveObservation(landmark, Observation(*seen));
  }
  for (const BundlePoint& point : problem.points) {
    if (map.ObservationsOf(point.id).size() < 2) editor.RemoveLandmark(point.id);
  }
}

void AdjustLocally(KeyframeId center, const LocalWindowOptions& window_options, const BundleOptions& bundle_options,
                   const KeyframeMotions& motions, MapEditor& editor) {
  const Map& map = editor.map();
  LocalWindow window = SelectLocalWindow(map, center, window_options);
  const std::vector<LandmarkId> unconfirmed = TakeUnconfirmed(map, window_options.num_confirming, window.landmarks);
  if (window.landmarks.empty()) return;
  const BundleProblem problem = BuildLocalProblem(map, window, window_options, motions);
  const std::optional<BundleResult> result = AdjustBundle(problem, bundle_options);
  if (result && IsCredible(problem, *result)) WriteBack(problem, *result, editor);
  const BundleProblem points = BuildPointProblem(map, problem, unconfirmed);
  if (points.points.empty()) return;
  if (const std::optional<BundleResult> adjusted = AdjustBundle(points, bundle_options))
    WriteBack(points, *adjusted, editor);
}

}  // namespace tessera
