#include "map/map.h"

#include <algorithm>
#include <bit>
#include <initializer_list>
#include <utility>

#include "core/sha256.h"

namespace tessera {
namespace {

// The hash of a map is the sum (modulo 2^64) of the hashes of its facts, so that it follows each change at once and
// does not depend on the order of changes. A fact's hash mixes its words by the finalizer of SplitMix64 (Steele et al.
// 2014).
class FactHash {
 public:
  explicit FactHash(uint64_t kind) : state_(kind) {}
  FactHash& Add(uint64_t word) {
    state_ += 0x9e3779b97f4a7c15ULL + word;
    state_ = (state_ ^ (state_ >> 30)) * 0xbf58476d1ce4e5b9ULL;
    state_ = (state_ ^ (state_ >> 27)) * 0x94d049bb133111ebULL;
    state_ ^= state_ >> 31;
    return *this;
  }
  FactHash& Add(int64_t value) { return Add(static_cast<uint64_t>(value)); }
  FactHash& Add(double value) { return Add(std::bit_cast<uint64_t>(value)); }
  FactHash& Add(const Eigen::Vector3d& v) { return Add(v.x()).Add(v.y()).Add(v.z()); }
  uint64_t value() const { return state_; }

 private:
  uint64_t state_;
};

uint64_t HashOf(const FeatureFrame& features) {
  FactHash hash(4);
  hash.Add(features.frame.value).Add(features.utime_us).Add(static_cast<int64_t>(features.keypoints.size()));
  const CameraCalibration& camera = features.calibration;
  hash.Add(static_cast<int64_t>(camera.sensor)).Add(int64_t{camera.width_px}).Add(int64_t{camera.height_px});
  for (const double number :
       {camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.baseline_m, camera.depth_unit_m}) {
    hash.Add(number);
  }
  if (camera.radial != 0.0) hash.Add(camera.radial);  // most cameras have none: maps made before keep their hashes
  if (!camera.right_shift.is_zero()) {
    const RightShift& shift = camera.right_shift;
    hash.Add(shift.center_px).Add(shift.across_px).Add(shift.down_px).Add(shift.bend_px);
  }
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    const Keypoint& k = features.keypoints[i];
    hash.Add(uint64_t{std::bit_cast<uint32_t>(k.x_px)} << 32 | std::bit_cast<uint32_t>(k.y_px));
    hash.Add(uint64_t{std::bit_cast<uint32_t>(k.right_x_px)} << 32 | std::bit_cast<uint32_t>(k.depth_m));
    hash.Add(uint64_t{k.score} << 16 | uint64_t{k.level} << 8 | k.angle);
    for (const uint64_t word : features.descriptors[i]) hash.Add(word);
  }
  return hash.value();
}

uint64_t HashOf(KeyframeId id, const Keyframe& keyframe) {
  const Eigen::Quaterniond& q = keyframe.world_from_camera.rotation;
  return FactHash(1)
      .Add(id.value)
      .Add(keyframe.parent.value)
      .Add(keyframe.features_hash)
      .Add(q.w())
      .Add(q.x())
      .Add(q.y())
      .Add(q.z())
      .Add(keyframe.world_from_camera.translation)
      .Add(keyframe.scale)
      .value();
}

uint64_t HashOf(LandmarkId id, const Landmark& landmark) {
  FactHash hash(2);
  hash.Add(id.value).Add(landmark.position_in_world).Add(landmark.normal);
  hash.Add(landmark.depth_sigma).Add(landmark.min_distance).Add(landmark.max_distance);
  for (const uint64_t word : landmark.descriptor) hash.Add(word);
  return hash.value();
}

uint64_t HashOf(const MapDelta::ChangedObservation& fact) {
  return FactHash(3)
      .Add(fact.landmark.value)
      .Add(fact.observation.keyframe.value)
      .Add(int64_t{fact.observation.keypoint})
      .value();
}

uint64_t HashOf(size_t index, const ClosedLoop& loop) {
  return FactHash(5)
      .Add(static_cast<int64_t>(index))
      .Add(loop.current.value)
      .Add(loop.matched.value)
      .Add(loop.scale)
      .Add(int64_t{loop.num_points})
      .value();
}

// A replica keeps a slot for each id up to the highest: one that leaps ahead of all others is nonsense.
constexpr int64_t kMaxIdLeap = int64_t{1} << 20;

std::string Name(KeyframeId id) { return "keyframe " + std::to_string(id.value); }
std::string Name(LandmarkId id) { return "landmark " + std::to_string(id.value); }

// Where the keyframe stands in the list, or would.
template <class Covisible>
auto PlaceOf(KeyframeId id, Covisible& covisible) {
  return std::lower_bound(covisible.begin(), covisible.end(), id,
                          [](const CovisibleKeyframe& other, KeyframeId key) { return other.id < key; });
}

void ChangeCount(KeyframeId id, int change, std::vector<CovisibleKeyframe>& covisible) {
  auto place = PlaceOf(id, covisible);
  if (place == covisible.end() || place->id != id) place = covisible.insert(place, {id, 0});
  place->num_shared += change;
  if (place->num_shared == 0) covisible.erase(place);
}

}  // namespace

Result<> Map::Apply(const MapDelta& delta) {
  if (delta.is_snapshot) {
    *this = Map();
    next_delta_ = delta.number;
  }
  if (delta.number != next_delta_) {
    return Failed("delta " + std::to_string(delta.number) + " came where " + std::to_string(next_delta_) +
                  " was expected");
  }
  if (const Result<> applied = ApplyLists(delta); !applied) {
    return Failed("delta " + std::to_string(delta.number) + ": " + applied.error().sentence);
  }
  ++next_delta_;
  answered_ = delta.answers;
  if (hash_ != delta.hash) {
    return Failed("delta " + std::to_string(delta.number) +
                  ": this replica of the map differs from the mapper's (wrong hash)");
  }
  return {};
}

Result<> Map::ApplyLists(const MapDelta& delta) {
  if (delta.lens.is_known()) ChangeLens(delta.lens);
  for (const auto& added : delta.new_keyframes) TESSERA_RETURN_IF_FAILED(AddKeyframe(added));
  for (const auto& moved : delta.moved_keyframes) TESSERA_RETURN_IF_FAILED(MoveKeyframe(moved));
  for (const auto& changed : delta.changed_landmarks) TESSERA_RETURN_IF_FAILED(ChangeLandmark(changed));
  for (const auto& removed : delta.removed_observations) TESSERA_RETURN_IF_FAILED(RemoveObservation(removed));
  if (delta.is_snapshot) {
    TESSERA_RETURN_IF_FAILED(ObserveAll(delta.new_observations));
    CountAllShared();
  } else {
    for (const auto& added : delta.new_observations) TESSERA_RETURN_IF_FAILED(AddObservation(added));
  }
  for (const auto& changed : delta.changed_parents) TESSERA_RETURN_IF_FAILED(ChangeParent(changed));
  for (const LandmarkId id : delta.removed_landmarks) TESSERA_RETURN_IF_FAILED(RemoveLandmark(id));
  for (const KeyframeId id : delta.removed_keyframes) TESSERA_RETURN_IF_FAILED(RemoveKeyframe(id));
  for (const ClosedLoop& loop : delta.closed_loops) AddClosedLoop(loop);
  return {};
}

void Map::ChangeLens(const LensCorrection& lens) {
  lens_ = lens;
  keyframes_.ForEach([&](KeyframeId id, const Keyframe& held) {
    Keyframe& keyframe = *keyframes_.Find(id);
    hash_ -= HashOf(id, held);
    keyframe.features = std::make_shared<const FeatureFrame>(WithLens(*held.features, lens_));
    keyframe.features_hash = HashOf(*keyframe.features);
    hash_ += HashOf(id, held);
  });
}

Result<> Map::AddKeyframe(const MapDelta::NewKeyframe& added) {
  if (!added.id.valid() || keyframes_.Has(added.id) || added.id.value > keyframes_.end_id() + kMaxIdLeap ||
      added.features == nullptr || added.features->descriptors.size() != added.features->keypoints.size()) {
    return Failed(Name(added.id) + " can't be added");
  }
  const size_t num_keypoints = added.features->keypoints.size();
  const Keyframe& keyframe = keyframes_.Put(added.id, {added.features,
                                                       HashOf(*added.features),
                                                       added.world_from_camera,
                                                       added.scale,
                                                       added.parent,
                                                       std::vector<LandmarkId>(num_keypoints),
                                                       {}});
  hash_ += HashOf(added.id, keyframe);
  return {};
}

Result<> Map::MoveKeyframe(const MapDelta::MovedKeyframe& moved) {
  Keyframe* keyframe = keyframes_.Find(moved.id);
  if (keyframe == nullptr) return Failed(Name(moved.id) + " is not there to be moved");
  hash_ -= HashOf(moved.id, *keyframe);
  keyframe->world_from_camera = moved.world_from_camera;
  keyframe->scale = moved.scale;
  hash_ += HashOf(moved.id, *keyframe);
  return {};
}

Result<> Map::ChangeLandmark(const MapDelta::ChangedLandmark& changed) {
  const auto& [id, landmark] = changed;
  if (!id.valid() || id.value > landmarks_.end_id() + kMaxIdLeap) return Failed(Name(id) + " can't be added");
  ObservedLandmark* held = landmarks_.Find(id);
  if (held == nullptr) held = &landmarks_.Put(id, {});
  hash_ -= held->hash;
  static_cast<Landmark&>(*held) = landmark;
  held->hash = HashOf(id, landmark);
  hash_ += held->hash;
  return {};
}

Result<> Map::ChangeParent(const MapDelta::ChangedParent& changed) {
  Keyframe* keyframe = keyframes_.Find(changed.id);
  if (keyframe == nullptr) return Failed(Name(changed.id) + " is not there to get another parent");
  hash_ -= HashOf(changed.id, *keyframe);
  keyframe->parent = changed.parent;
  hash_ += HashOf(changed.id, *keyframe);
  return {};
}

Result<> Map::RemoveLandmark(LandmarkId id) {
  const ObservedLandmark* landmark = landmarks_.Find(id);
  if (landmark == nullptr || landmark->observations.size() > 0) return Failed(Name(id) + " can't be removed");
  hash_ -= landmark->hash;
  landmarks_.Remove(id);
  return {};
}

Result<> Map::RemoveKeyframe(KeyframeId id) {
  const Keyframe* keyframe = keyframes_.Find(id);
  if (keyframe == nullptr || std::any_of(keyframe->landmarks.begin(), keyframe->landmarks.end(),
                                         [](LandmarkId landmark) { return landmark.valid(); })) {
    return Failed(Name(id) + " can't be removed");
  }
  hash_ -= HashOf(id, *keyframe);
  keyframes_.Remove(id);
  return {};
}

Result<> Map::AddObservation(const MapDelta::ChangedObservation& change) {
  TESSERA_RETURN_IF_FAILED(Observe(change));
  CountShared(change, 1);
  return {};
}

Result<> Map::Observe(const MapDelta::ChangedObservation& change) {
  const auto& [landmark_id, observation] = change;
  Keyframe* keyframe = keyframes_.Find(observation.keyframe);
  ObservedLandmark* landmark = landmarks_.Find(landmark_id);
  if (keyframe == nullptr || landmark == nullptr || observation.keypoint < 0 ||
      Index(observation.keypoint) >= keyframe->landmarks.size() ||
      keyframe->landmarks[Index(observation.keypoint)].valid()) {
    return Failed(Name(observation.keyframe) + " can't observe " + Name(landmark_id));
  }
  const std::span<const Observation> others = landmark->observations.span();
  const auto next = std::lower_bound(others.begin(), others.end(), Observation{observation.keyframe, -1});
  if (next != others.end() && next->keyframe == observation.keyframe) {
    return Failed(Name(observation.keyframe) + " can't observe " + Name(landmark_id) + " twice");
  }
  landmark->observations.Insert(others.data() + (next - others.begin()), observation);
  keyframe->landmarks[Index(observation.keypoint)] = landmark_id;
  hash_ += HashOf(change);
  return {};
}

// Each goes to another keyframe's list, which is in no cache: it is fetched some steps ahead.
Result<> Map::ObserveAll(const std::vector<MapDelta::ChangedObservation>& all) {
  constexpr size_t kStepsAhead = 16;
  for (size_t i = 0; i < all.size(); ++i) {
    const Observation& ahead = all[std::min(i + kStepsAhead, all.size() - 1)].observation;
    const Keyframe* keyframe = keyframes_.Find(ahead.keyframe);
    if (keyframe != nullptr && ahead.keypoint >= 0 && Index(ahead.keypoint) < keyframe->landmarks.size()) {
      __builtin_prefetch(&keyframe->landmarks[Index(ahead.keypoint)], 1);
    }
    TESSERA_RETURN_IF_FAILED(Observe(all[i]));
  }
  return {};
}

Result<> Map::RemoveObservation(const MapDelta::ChangedObservation& change) {
  const auto& [landmark_id, observation] = change;
  Keyframe* keyframe = keyframes_.Find(observation.keyframe);
  ObservedLandmark* landmark = landmarks_.Find(landmark_id);
  const Observation* seen = nullptr;
  if (landmark != nullptr) {
    seen = std::find(landmark->observations.begin(), landmark->observations.end(), observation);
  }
  if (keyframe == nullptr || landmark == nullptr || seen == landmark->observations.end()) {
    return Failed(Name(observation.keyframe) + " does not observe " + Name(landmark_id));
  }
  CountShared(change, -1);
  landmark->observations.Remove(seen);
  keyframe->landmarks[Index(observation.keypoint)] = LandmarkId{};
  hash_ -= HashOf(change);
  return {};
}

void Map::AddClosedLoop(const ClosedLoop& loop) {
  hash_ += HashOf(closed_loops_.size(), loop);
  closed_loops_.push_back(loop);
}

// The keyframe sees a landmark that others see, since now (1) or for the last time (-1).
void Map::CountShared(const MapDelta::ChangedObservation& change, int num) {
  const KeyframeId id = change.observation.keyframe;
  std::vector<CovisibleKeyframe>& covisible = keyframes_.Find(id)->covisible;
  for (const Observation& other : landmarks_.Find(change.landmark)->observations) {
    if (other.keyframe == id) continue;
    ChangeCount(other.keyframe, num, covisible);
    ChangeCount(id, num, keyframes_.Find(other.keyframe)->covisible);
  }
}

// The same as counting each observation when it comes, in less than a quarter of the time for a large map. Each pair of
// keyframes is counted once, at the lower id; so each list fills up by id. The observers are listed one after the other
// first: asked of the landmarks, which lie far apart, they would take most of the time.
void Map::CountAllShared() {
  std::vector<int32_t> observers;  // ids of keyframes, highest first, and a -1 behind those of each landmark
  std::vector<uint32_t> first_observer(static_cast<size_t>(landmarks_.end_id()), 0);
  landmarks_.ForEach([&](LandmarkId id, const ObservedLandmark& landmark) {
    first_observer[static_cast<size_t>(id.value)] = static_cast<uint32_t>(observers.size());
    const std::span<const Observation> seen = landmark.observations.span();
    for (auto o = seen.rbegin(); o != seen.rend(); ++o) observers.push_back(static_cast<int32_t>(o->keyframe.value));
    observers.push_back(-1);
  });
  std::vector<int32_t> num_shared(static_cast<size_t>(keyframes_.end_id()), 0);
  std::vector<int32_t> higher;
  for (KeyframeId id{0}; id.value < keyframes_.end_id(); ++id.value) {
    Keyframe* keyframe = keyframes_.Find(id);
    if (keyframe == nullptr) continue;
    for (const LandmarkId landmark : keyframe->landmarks) {
      if (!landmark.valid()) continue;
      const int32_t* other = &observers[first_observer[static_cast<size_t>(landmark.value)]];
      for (; *other > id.value; ++other) {
        if (num_shared[static_cast<size_t>(*other)]++ == 0) higher.push_back(*other);
      }
    }
    std::ranges::sort(higher);
    for (const int32_t other : higher) {
      const int32_t num_both = std::exchange(num_shared[static_cast<size_t>(other)], 0);
      keyframe->covisible.push_back({{other}, num_both});
      keyframes_.Find({other})->covisible.push_back({id, num_both});
    }
    higher.clear();
  }
}

std::vector<KeyframeId> Map::Covisible(KeyframeId id, int max_num, int min_shared) const {
  std::vector<std::pair<int32_t, KeyframeId>> ranked;
  if (const Keyframe* keyframe = keyframes_.Find(id); keyframe != nullptr) {
    ranked.reserve(keyframe->covisible.size());
    for (const auto& [other, num_shared] : keyframe->covisible) {
      if (num_shared >= min_shared) ranked.emplace_back(-num_shared, other);
    }
  }
  const size_t num = std::min(ranked.size(), static_cast<size_t>(max_num));
  const auto end = ranked.begin() + static_cast<ptrdiff_t>(num);
  if (end != ranked.end()) std::nth_element(ranked.begin(), end, ranked.end());
  std::sort(ranked.begin(), end);
  std::vector<KeyframeId> ids;
  ids.reserve(num);
  for (size_t i = 0; i < num; ++i) ids.push_back(ranked[i].second);
  return ids;
}

int Map::NumShared(KeyframeId a, KeyframeId b) const {
  const Keyframe* keyframe = keyframes_.Find(a);
  if (keyframe == nullptr) return 0;
  const auto place = PlaceOf(b, keyframe->covisible);
  return place != keyframe->covisible.end() && place->id == b ? place->num_shared : 0;
}

MapDelta Map::Snapshot() const {
  MapDelta delta;
  delta.number = next_delta_ == 0 ? 0 : next_delta_ - 1;
  delta.answers = answered_;
  delta.is_snapshot = true;
  delta.hash = hash_;
  delta.lens = lens_;
  size_t num_observations = 0;
  landmarks_.ForEach(
      [&](LandmarkId, const ObservedLandmark& landmark) { num_observations += landmark.observations.span().size(); });
  delta.new_keyframes.reserve(static_cast<size_t>(keyframes_.size()));
  delta.changed_landmarks.reserve(static_cast<size_t>(landmarks_.size()));
  delta.new_observations.reserve(num_observations);
  keyframes_.ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    delta.new_keyframes.push_back({id, keyframe.parent, keyframe.world_from_camera, keyframe.features, keyframe.scale});
  });
  landmarks_.ForEach([&](LandmarkId id, const ObservedLandmark& landmark) {
    delta.changed_landmarks.push_back({id, landmark});
    for (const Observation& observation : landmark.observations) {
      delta.new_observations.push_back({id, observation});
    }
  });
  delta.closed_loops = closed_loops_;
  return delta;
}

std::string Map::Sha256Hex() const {
  Sha256 sha;
  keyframes_.ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    sha.Add(id.value);
    sha.Add(static_cast<int64_t>(keyframe.features_hash));
    sha.Add(keyframe.parent.value);
    const Eigen::Quaterniond& q = keyframe.world_from_camera.rotation;
    const Eigen::Vector3d& t = keyframe.world_from_camera.translation;
    for (const double number : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), keyframe.scale}) sha.Add(number);
    for (const LandmarkId landmark : keyframe.landmarks) sha.Add(landmark.value);
  });
  landmarks_.ForEach([&](LandmarkId id, const Landmark& landmark) {
    sha.Add(id.value);
    for (const Eigen::Vector3d& v : {landmark.position_in_world, landmark.normal}) {
      for (const double number : {v.x(), v.y(), v.z()}) sha.Add(number);
    }
    sha.Add(landmark.depth_sigma);
    sha.Add(landmark.min_distance);
    sha.Add(landmark.max_distance);
    for (const uint64_t word : landmark.descriptor) sha.Add(static_cast<int64_t>(word));
  });
  for (const ClosedLoop& loop : closed_loops_) {
    sha.Add(loop.current.value);
    sha.Add(loop.matched.value);
    sha.Add(loop.scale);
    sha.Add(int64_t{loop.num_points});
  }
  return sha.HexDigest();
}

}  // namespace tessera
