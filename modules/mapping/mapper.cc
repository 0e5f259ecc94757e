#include "mapping/mapper.h"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "map/map_editor.h"
#include "measurement/landmark_description.h"
#include "measurement/landmark_view.h"
#include "optimization/local_adjustment.h"

namespace tessera {
namespace {

bool CanObserve(const Map& map, KeyframeId keyframe, int32_t keypoint, LandmarkId landmark) {
  const Keyframe* observer = map.FindKeyframe(keyframe);
  if (observer == nullptr || map.FindLandmark(landmark) == nullptr || keypoint < 0 ||
      static_cast<size_t>(keypoint) >= observer->landmarks.size() ||
      observer->landmarks[static_cast<size_t>(keypoint)].valid()) {
    return false;
  }
  return !map.IsSeenBy(landmark, keyframe);
}

// The spanning tree's parent of a new keyframe: the one that shares most landmarks.
void ChooseParent(KeyframeId id, MapEditor& editor) {
  const std::vector<KeyframeId> best = editor.map().Covisible(id, 1);
  if (!best.empty() && best.front() != editor.map().FindKeyframe(id)->parent) {
    editor.SetParent(id, best.front());
  }
}

// Whether the remaining observations determine the position: two of them, or one with depth.
bool IsDetermined(const Map& map, LandmarkId id) {
  const std::span<const Observation> observations = map.ObservationsOf(id);
  if (observations.size() != 1) return observations.size() > 1;
  return SeenAt(*map.FindKeyframe(observations[0].keyframe)->features, observations[0].keypoint).has_right();
}

// Descriptors, normals and distances follow from observations and poses; landmarks that are no longer determined go.
void RefreshDescriptions(MapEditor& editor) {
  for (const LandmarkId id : editor.touched_landmarks().Ids()) {
    if (!IsDetermined(editor.map(), id)) {
      editor.RemoveLandmark(id);
    } else {
      const bool is_reobserved = editor.reobserved_landmarks().Has(id);
      editor.ChangeLandmark(
          id, is_reobserved ? DescribeLandmark(editor.map(), id) : DescribeMovedLandmark(editor.map(), id));
    }
  }
}

}  // namespace

Result<> MapperOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(creation.Check());
  TESSERA_RETURN_IF_FAILED(fusion.Check());
  TESSERA_RETURN_IF_FAILED(window.Check());
  TESSERA_RETURN_IF_FAILED(bundle.Check());
  if (max_iterations_with_depth < 1 || max_outer_keyframes_with_depth < 1) {
    return Failed("with depth, too, the window needs an iteration and a pose that holds it");
  }
  TESSERA_RETURN_IF_FAILED(landmark_culling.Check());
  if (num_cautious_keyframes < 0)
    return Failed("the number of keyframes that are mapped with caution can't be negative");
  return keyframe_culling.Check();
}

Mapper::Mapper(const MapperOptions& options) : options_(options), keyframe_culler_(options.keyframe_culling) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
}

MapDelta Mapper::Process(const KeyframeObservation& seen, const DueCorrections& due) {
  MapEditor editor(map_);
  ApplyDue(due, seen.id, editor);
  const bool has_new_lens = RefineLens(seen, editor), is_mended = MendScale(seen, editor);
  is_repeatable_ = due.loops.empty() && !due.adjustment && !has_new_lens && !is_mended;
  RemoveNotScene(seen, editor);
  Insert(seen, editor);
  RememberMotion(seen);
  ObserveLandmarks(seen, editor);
  ObserveShared(seen, editor);
  ChooseParent(seen.id, editor);
  recent_landmarks_.Cull(seen.id, options_.landmark_culling, editor);
  const std::vector<LandmarkId> from_pairs = CreateLandmarks(seen.id, editor);
  FuseLandmarks(seen.id, options_.fusion, editor);
  if (IsCautious(seen.id)) RemoveUnconfirmed(seen.id, from_pairs, options_.landmark_culling, editor);
  AdjustAround(seen, editor);
  keyframe_culler_.Cull(seen.id, removed_, editor);
  RefreshDescriptions(editor);
  MapDelta delta = editor.Finish(seen.id);
  for (const KeyframeId id : delta.removed_keyframes) motions_.erase(id);
  delta.asks_adjustment = AskForAdjustment(seen.id);
  return delta;
}

MapperStep Mapper::LastStep(const MapDelta& delta) const {
  MapperStep step{.is_repeatable = is_repeatable_, .delta = {}, .removed = {}, .first_recent = {}, .end_landmark = {}};
  step.delta.number = delta.number;
  step.delta.answers = delta.answers;
  if (!is_repeatable_) return step;
  step.delta = delta;
  for (const KeyframeId id : delta.removed_keyframes) step.removed.push_back(*removed_.LinkOf(id));
  step.first_recent = first_recent_;
  step.end_landmark = {map_.landmarks().end_id()};
  return step;
}

// In the order of Process: what looks at the map before the step, the step, and what looks at it then.
Result<> Mapper::Repeat(const KeyframeObservation& seen, const MapperStep& step) {
  const MapDelta& delta = step.delta;
  if (delta.answers != seen.id) return Failed("it is a step of keyframe " + std::to_string(delta.answers.value));
  MapEditor before(map_);
  RefineLens(seen, before);  // which finds nothing, but counts its looks
  TESSERA_RETURN_IF_FAILED(map_.Apply(delta));
  map_.RaiseEnd(step.end_landmark);
  RememberMotion(seen);
  recent_landmarks_.ForgetOld(seen.id, options_.landmark_culling, map_);
  std::vector<LandmarkId> recent;
  for (LandmarkId id = step.first_recent; id < step.end_landmark; ++id.value) {
    if (map_.FindLandmark(id) != nullptr) recent.push_back(id);
  }
  recent_landmarks_.Add(seen.id, recent);
  for (const KeyframeLink& link : step.removed) removed_.Add(link);
  keyframe_culler_.Follow(seen.id, map_);
  for (const KeyframeId id : delta.removed_keyframes) motions_.erase(id);
  AskForAdjustment(seen.id);
  return {};
}

std::optional<MapDelta> Mapper::Finish(const DueCorrections& due) {
  MapEditor editor(map_);
  const KeyframeId last = map_.answered();
  const bool has_moved = ApplyDue(due, {last.value + 1}, editor);
  // Keyframes that came after the last adjustment was requested take part in another one.
  wants_adjustment_ |= last_asked_.valid() && last_asked_ < last;
  wants_adjustment_ |= options_.polishes && !is_polish_asked_;
  const bool has_culled = !std::exchange(is_culled_, true) && CullLast(last, editor);
  if (!has_moved && !wants_adjustment_ && !has_culled) return std::nullopt;
  RefreshDescriptions(editor);
  MapDelta delta = editor.Finish(last);
  delta.asks_adjustment = AskForAdjustment(last);
  is_polish_asked_ |= delta.asks_adjustment;
  return delta;
}

// Whether a keyframe went.
bool Mapper::CullLast(KeyframeId last, MapEditor& editor) {
  const int64_t num_before = map_.keyframes().size();
  keyframe_culler_.CullLast(last, removed_, editor);
  return map_.keyframes().size() < num_before;
}

// Whether anything moved. Loops come first, since they change more; they outdate the adjustment.
bool Mapper::ApplyDue(const DueCorrections& due, KeyframeId now, MapEditor& editor) {
  bool has_moved = ApplyDueLoops(due.loops, now, editor);
  if (due.adjustment) has_moved |= ApplyDueAdjustment(*due.adjustment, now, editor);
  return has_moved;
}

// A loop that was found before the last correction of the map is measured against poses that are gone.
bool Mapper::ApplyDueLoops(const std::vector<LoopResult>& loops, KeyframeId now, MapEditor& editor) {
  bool has_moved = false;
  for (const LoopResult& loop : loops) {
    const bool is_there = map_.FindKeyframe(loop.answers) != nullptr && map_.FindKeyframe(loop.matched) != nullptr;
    if (!is_there || loop.answers < last_corrected_) {
      ++num_void_loops_;
      continue;
    }
    CloseLoop(loop, options_.loop_fusion, editor);
    AdjustLocally(loop.answers, Window(now), options_.bundle, motions_, editor);
    last_corrected_ = now;
    wants_adjustment_ = is_base_outdated_ = has_moved = true;
  }
  return has_moved;
}

bool Mapper::ApplyDueAdjustment(const GlobalAdjustment& adjustment, KeyframeId now, MapEditor& editor) {
  const bool applies = adjustment.is_usable && !is_base_outdated_;
  if (applies) {
    ApplyAdjustment(adjustment, *base_, editor);
    last_corrected_ = now;
  }
  base_.reset();
  return applies;
}

bool Mapper::RefineLens(const KeyframeObservation& seen, MapEditor& editor) {
  const CameraCalibration& given = seen.features.calibration;
  if (!options_.refines_focal || !lens_refiner_.Refine(seen.id, given, editor)) return false;
  NoteCorrected(seen.id);
  wants_adjustment_ |= given.sensor == SensorType::kStereo;  // what is older was mapped with columns that have moved
  return true;
}

// Where a loop was closed since the scale slipped, it has set the scale.
bool Mapper::MendScale(const KeyframeObservation& seen, MapEditor& editor) {
  if (seen.mendings.empty()) return false;
  const KeyframeId reference = removed_.Successor(map_, seen.reference);
  if (!reference.valid()) return false;
  for (const ClosedLoop& loop : map_.closed_loops()) {
    if (loop.current >= seen.mendings.front().keyframe) return false;
  }
  ApplyCorrections(ScaleCorrections(map_, reference, seen.mendings), editor);
  ++num_scale_mendings_;
  NoteCorrected(seen.id);
  return true;
}

void Mapper::RemoveNotScene(const KeyframeObservation& seen, MapEditor& editor) {
  for (const LandmarkId id : seen.not_scene) {
    if (map_.FindLandmark(id) != nullptr) editor.RemoveLandmark(id);
  }
}

// Poses moved: what loops and an adjustment under way are measured against is gone.
void Mapper::NoteCorrected(KeyframeId now) {
  last_corrected_ = now;
  is_base_outdated_ = base_.has_value();
  wants_adjustment_ |= is_base_outdated_;
}

bool Mapper::AskForAdjustment(KeyframeId now) {
  if (!wants_adjustment_ || base_) return false;
  base_ = TakeBase(map_);
  last_asked_ = now;
  wants_adjustment_ = is_base_outdated_ = false;
  return true;
}

// world_from_keyframe = world_from_reference (as the map has it now) * reference_from_camera
void Mapper::Insert(const KeyframeObservation& seen, MapEditor& editor) {
  const size_t num_keypoints = seen.features.keypoints.size();
  if (!seen.id.valid() || map_.FindKeyframe(seen.id) != nullptr || seen.landmarks.size() != num_keypoints ||
      seen.features.descriptors.size() != num_keypoints) {
    throw std::invalid_argument("keyframe " + std::to_string(seen.id.value) +
                                " is not new, or its lists do not fit its keypoints");
  }
  const std::optional<Sim3> world_from_reference = removed_.Find(map_, seen.reference);
  const Sim3 world_from_keyframe =
      world_from_reference ? *world_from_reference * seen.reference_from_camera : Sim3::From(seen.world_from_camera);
  editor.AddKeyframe(seen.id, removed_.Successor(map_, seen.reference), world_from_keyframe,
                     std::make_shared<const FeatureFrame>(WithLens(seen.features, map_.lens())));
}

void Mapper::RememberMotion(const KeyframeObservation& seen) {
  if (!seen.expected.is_known()) return;
  motions_[seen.id] = {seen.reference, seen.expected};
  cautious_until_ = {seen.id.value + options_.num_cautious_keyframes};
}

// Without caution, the pair that made a landmark is enough for it to move poses.
LocalWindowOptions Mapper::Window(KeyframeId now) const {
  constexpr size_t kPair = 2;
  LocalWindowOptions window = options_.window;
  if (!IsCautious(now)) window.num_confirming = kPair;
  return window;
}

void Mapper::AdjustAround(const KeyframeObservation& seen, MapEditor& editor) {
  LocalWindowOptions window = Window(seen.id);
  BundleOptions bundle = options_.bundle;
  if (seen.features.calibration.sensor != SensorType::kMono) {
    window.max_outer_keyframes = std::min(window.max_outer_keyframes, options_.max_outer_keyframes_with_depth);
    bundle.max_num_iterations = std::min(bundle.max_num_iterations, options_.max_iterations_with_depth);
  }
  AdjustLocally(seen.id, window, bundle, motions_, editor);
}

void Mapper::ObserveLandmarks(const KeyframeObservation& seen, MapEditor& editor) {
  for (size_t i = 0; i < seen.landmarks.size(); ++i) {
    const auto keypoint = static_cast<int32_t>(i);
    if (seen.landmarks[i].valid() && CanObserve(map_, seen.id, keypoint, seen.landmarks[i])) {
      editor.AddObservation(seen.landmarks[i], {seen.id, keypoint});
    }
  }
}

// Matches with keypoints of earlier keyframes: their landmark is observed, or created where there is none yet.
void Mapper::ObserveShared(const KeyframeObservation& seen, MapEditor& editor) {
  std::vector<LandmarkId> created;
  for (const SharedKeypoint& shared : seen.shared) {
    const Keyframe* other = map_.FindKeyframe(shared.other);
    if (other == nullptr || shared.other_keypoint < 0 ||
        static_cast<size_t>(shared.other_keypoint) >= other->landmarks.size()) {
      continue;
    }
    LandmarkId landmark = other->landmarks[static_cast<size_t>(shared.other_keypoint)];
    if (!landmark.valid()) {
      const Keyframe& own = *map_.FindKeyframe(seen.id);
      if (shared.keypoint < 0 || static_cast<size_t>(shared.keypoint) >= own.landmarks.size() ||
          own.landmarks[static_cast<size_t>(shared.keypoint)].valid()) {
        continue;
      }
      landmark = editor.AddLandmark({.position_in_world = other->WorldFromKeyframe() * shared.position_in_other});
      editor.AddObservation(landmark, {shared.other, shared.other_keypoint});
      created.push_back(landmark);
    }
    if (CanObserve(map_, seen.id, shared.keypoint, landmark)) {
      editor.AddObservation(landmark, {seen.id, shared.keypoint});
    }
  }
  for (const LandmarkId landmark : created) {
    editor.ChangeLandmark(landmark, DescribeLandmark(map_, landmark));
  }
}

std::vector<LandmarkId> Mapper::CreateLandmarks(KeyframeId id, MapEditor& editor) {
  CreationOptions creation = options_.creation;
  creation.matching.needs_far_end = IsCautious(id);
  first_recent_ = {map_.landmarks().end_id()};
  std::vector<LandmarkId> from_pairs = CreateFromPairs(id, creation, editor);
  recent_landmarks_.Add(id, from_pairs);
  recent_landmarks_.Add(id, CreateFromDepth(id, options_.creation, editor));
  return from_pairs;
}

}  // namespace tessera
