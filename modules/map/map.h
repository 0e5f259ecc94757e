// The map: keyframes, landmarks, and which keyframe saw which landmark where.
//
// The mapper alone decides on changes. It writes them down as numbered deltas, and everybody, the mapper included,
// holds a map that changes by Apply(delta) and by nothing else. So all replicas are equal, and the hash that each delta
// carries shows at once if one is not. A snapshot is a delta that starts from the empty map.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/id_map.h"
#include "core/ids.h"
#include "core/result.h"
#include "core/small_vector.h"
#include "features/feature_types.h"
#include "geometry/rigid3.h"

namespace tessera {

// Where a keyframe saw a landmark.
struct Observation {
  KeyframeId keyframe;
  int32_t keypoint = -1;  // index into the keyframe's features
  auto operator<=>(const Observation&) const = default;
};

// A landmark (map point) as the mapper estimated it.
struct Landmark {
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();  // meters (mono: units of the map)
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // mean unit direction from the landmark to the cameras that saw it
  double depth_sigma = 0.0;   // standard deviation of the position along the normal, as its observers alone fix it
  double min_distance = 0.0;  // between these distances from a camera its scale fits the pyramid
  double max_distance = 0.0;
  Descriptor descriptor{};  // the observation's that is nearest to all others
  bool operator==(const Landmark&) const = default;
};

// A landmark in the map, and who sees it.
struct ObservedLandmark : Landmark {
  SmallVector<Observation, 4> observations;  // sorted by keyframe
  uint64_t hash = 0;                         // the landmark's share of the map's, without its observations

  bool IsSeenBy(KeyframeId keyframe) const {
    return std::any_of(observations.begin(), observations.end(),
                       [keyframe](const Observation& observation) { return observation.keyframe == keyframe; });
  }
};

// A keyframe that shares landmarks with another one.
struct CovisibleKeyframe {
  KeyframeId id;
  int32_t num_shared = 0;
  bool operator==(const CovisibleKeyframe&) const = default;
};

// A keyframe in the map: its features never change, but for the lens that they were seen by (Map::lens); its
// pose does.
//
// Closing a loop of mono changes the scale of the map, by another factor at each keyframe. What was measured relative
// to a keyframe (poses of frames) stays true in the units of that time: those of its map part when it began.
struct Keyframe {
  std::shared_ptr<const FeatureFrame> features;
  uint64_t features_hash = 0;  // of their exact content
  Rigid3 world_from_camera;
  double scale = 1.0;  // length of such a unit in today's world; always 1 but for mono

  // Places what was measured relative to the keyframe, in the units of that time.
  Sim3 WorldFromKeyframe() const { return Sim3::From(world_from_camera, scale); }

  KeyframeId parent;  // spanning tree: the older keyframe that shared most landmarks at birth; invalid: the root
  std::vector<LandmarkId> landmarks;         // by keypoint; invalid: none
  std::vector<CovisibleKeyframe> covisible;  // by id
};

// Two keyframes that see the same place, by which the map was corrected.
struct ClosedLoop {
  KeyframeId current;      // the one that came back
  KeyframeId matched;      // the older one
  double scale = 1.0;      // mono: factor by which the map around `current` was scaled
  int32_t num_points = 0;  // landmarks that both see
  bool operator==(const ClosedLoop&) const = default;
};

// One numbered change of the map. The lists are applied in the order in which they stand here.
struct MapDelta {
  struct NewKeyframe {
    KeyframeId id;
    KeyframeId parent;
    Rigid3 world_from_camera;
    std::shared_ptr<const FeatureFrame> features;
    double scale = 1.0;
  };
  struct MovedKeyframe {
    KeyframeId id;
    Rigid3 world_from_camera;
    double scale = 1.0;
  };
  struct ChangedLandmark {
    LandmarkId id;
    Landmark landmark;
  };
  struct ChangedObservation {
    LandmarkId landmark;
    Observation observation;
    auto operator<=>(const ChangedObservation&) const = default;
  };
  struct ChangedParent {
    KeyframeId id;
    KeyframeId parent;
  };

  int64_t number = 0;        // counts from 0; a replica applies them in order
  KeyframeId answers;        // the keyframe whose processing made this delta: its logical time
  bool is_snapshot = false;  // starts from the empty map, whatever the replica held
  LensCorrection lens;       // of all keyframes from now on; new_keyframes bring it. Not known: as before
  std::vector<NewKeyframe> new_keyframes;
  std::vector<MovedKeyframe> moved_keyframes;
  std::vector<ChangedLandmark> changed_landmarks;  // new ones too
  std::vector<ChangedObservation> removed_observations;
  std::vector<ChangedObservation> new_observations;
  std::vector<ChangedParent> changed_parents;
  std::vector<LandmarkId> removed_landmarks;  // must have no observations left
  std::vector<KeyframeId> removed_keyframes;  // likewise
  std::vector<ClosedLoop> closed_loops;
  bool asks_adjustment = false;  // what the global adjuster makes of the map after this delta is waited for
  uint64_t hash = 0;             // of the map after this delta
};

class Map {
 public:
  // Fails where the delta does not fit this map, which is unusable afterwards (ask for a snapshot).
  Result<> Apply(const MapDelta& delta);

  // The owner has given out landmark ids below this one, also such as no delta tells.
  void RaiseEnd(LandmarkId end) { landmarks_.RaiseEnd(end.value); }

  // Number that the next delta must have.
  int64_t next_delta() const { return next_delta_; }
  // The keyframe that the last delta answered; invalid: there was none.
  KeyframeId answered() const { return answered_; }
  // Depends on the exact content alone, not on the way that led to it; kept up to date by each change.
  uint64_t hash() const { return hash_; }

  const Keyframe* FindKeyframe(KeyframeId id) const { return keyframes_.Find(id); }
  const Landmark* FindLandmark(LandmarkId id) const { return landmarks_.Find(id); }
  // Sorted by keyframe; empty if there is no such landmark.
  std::span<const Observation> ObservationsOf(LandmarkId id) const {
    const ObservedLandmark* landmark = landmarks_.Find(id);
    return landmark == nullptr ? std::span<const Observation>{} : landmark->observations.span();
  }
  bool IsSeenBy(LandmarkId id, KeyframeId keyframe) const {
    const ObservedLandmark* landmark = landmarks_.Find(id);
    return landmark != nullptr && landmark->IsSeenBy(keyframe);
  }
  const IdMap<KeyframeId, Keyframe>& keyframes() const { return keyframes_; }
  const IdMap<LandmarkId, ObservedLandmark>& landmarks() const { return landmarks_; }
  // That of all keyframes, where the mapper found the calibration wrong; else not known.
  const LensCorrection& lens() const { return lens_; }
  // In the order in which they were closed. Their keyframes stay in the map.
  const std::vector<ClosedLoop>& closed_loops() const { return closed_loops_; }

  // Keyframes that share at least `min_shared` landmarks with `id`, most first, ties by lower id, at most `max_num`.
  std::vector<KeyframeId> Covisible(KeyframeId id, int max_num, int min_shared = 1) const;
  // How many landmarks both keyframes see.
  int NumShared(KeyframeId a, KeyframeId b) const;

  // The whole map as a delta.
  MapDelta Snapshot() const;
  // SHA-256 of the exact content: `map_sha256`.
  std::string Sha256Hex() const;

 private:
  friend class MapEditor;  // the owner applies its edits one by one, and counts them as one delta

  Result<> ApplyLists(const MapDelta& delta);
  void ChangeLens(const LensCorrection& lens);
  Result<> AddKeyframe(const MapDelta::NewKeyframe& added);
  Result<> MoveKeyframe(const MapDelta::MovedKeyframe& moved);
  Result<> ChangeLandmark(const MapDelta::ChangedLandmark& changed);
  Result<> ChangeParent(const MapDelta::ChangedParent& changed);
  Result<> RemoveLandmark(LandmarkId id);
  Result<> RemoveKeyframe(KeyframeId id);
  Result<> AddObservation(const MapDelta::ChangedObservation& change);
  Result<> RemoveObservation(const MapDelta::ChangedObservation& change);
  void AddClosedLoop(const ClosedLoop& loop);
  Result<> Observe(const MapDelta::ChangedObservation& change);  // counts nothing
  Result<> ObserveAll(const std::vector<MapDelta::ChangedObservation>& all);
  void CountShared(const MapDelta::ChangedObservation& change, int num);
  void CountAllShared();

  IdMap<KeyframeId, Keyframe> keyframes_;
  IdMap<LandmarkId, ObservedLandmark> landmarks_;
  std::vector<ClosedLoop> closed_loops_;
  LensCorrection lens_;
  int64_t next_delta_ = 0;
  KeyframeId answered_;
  uint64_t hash_ = 0;
};

}  // namespace tessera
