// What odometry remembers: keyframes, landmarks, and which keyframe saw which landmark.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/id_map.h"
#include "core/ids.h"
#include "geometry/rigid3.h"
#include "geometry/triangulation.h"
#include "tracking/frame_view.h"

namespace tessera {

// A keypoint of a keyframe.
struct Sighting {
  KeyframeId keyframe;
  int32_t keypoint = -1;
};

struct OdometryLandmark {
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the position, poses taken as exact
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();      // mean unit direction towards the cameras that saw it
  double reach = 0.0;         // distance times kLevelScale^level at the newest sighting: it shows at level
                              // log(reach / distance) / log(kLevelScale)
  Descriptor descriptor{};    // of the sighting that is nearest to all others
  std::vector<Sighting> sightings;  // by keyframe
  KeyframeId birth;           // newest keyframe when it was made
  int64_t num_expected = 0;   // frames in which it should have been seen since
  int64_t num_found = 0;      // frames in which it was
};

struct OdometryKeyframe {
  std::shared_ptr<const FrameView> view;
  Rigid3 camera_from_world;
  std::vector<LandmarkId> landmarks;  // by keypoint; invalid: none
  KeyframeId reference;               // the keyframe by which it was located; invalid: a new part of the map begins here
  Rigid3 reference_from_camera;
};

class OdometryMap {
 public:
  bool empty() const { return keyframes_.size() == 0; }
  const IdMap<KeyframeId, OdometryKeyframe>& keyframes() const { return keyframes_; }
  const IdMap<LandmarkId, OdometryLandmark>& landmarks() const { return landmarks_; }
  const OdometryKeyframe& keyframe(KeyframeId id) const { return *keyframes_.Find(id); }
  const OdometryLandmark& landmark(LandmarkId id) const { return *landmarks_.Find(id); }
  OdometryLandmark& landmark(LandmarkId id) { return *landmarks_.Find(id); }
  KeyframeId newest() const { return {keyframes_.end_id() - 1}; }

  // Ids count up. `landmarks` by keypoint, empty for none.
  KeyframeId AddKeyframe(std::shared_ptr<const FrameView> view, const Rigid3& camera_from_world,
                         KeyframeId reference, const std::vector<LandmarkId>& landmarks);
  // Its keypoints become free and landmarks that nothing else saw go with it.
  void RemoveKeyframe(KeyframeId id);
  // Makes a landmark of free keypoints, at most one for each keyframe.
  LandmarkId AddLandmark(const PointRefinement& point, const std::vector<Sighting>& sightings);
  void RemoveLandmark(LandmarkId id);
  // The keypoint must be free and the landmark not yet seen by that keyframe.
  void AddSighting(LandmarkId id, const Sighting& sighting);
  // Leaves the landmark, possibly without sightings.
  void RemoveSighting(LandmarkId id, KeyframeId keyframe);
  // `kept` takes over the sightings of `removed` in keyframes that don't see it yet.
  void Merge(LandmarkId removed, LandmarkId kept);
  // Takes a new position, and computes anew what follows from position and sightings (at least one).
  void Describe(LandmarkId id, const PointRefinement& point);

  bool Sees(KeyframeId keyframe, LandmarkId id) const;
  // Free: no landmark yet.
  bool IsFree(const Sighting& s) const {
    return !keyframe(s.keyframe).landmarks[static_cast<size_t>(s.keypoint)].valid();
  }
  // What the landmark's sightings measured.
  std::vector<PointView> Views(const std::vector<Sighting>& sightings) const;

  // Keyframes that share at least `min_shared` landmarks with `id`, most first, ties by higher id, at most `max_num`.
  std::vector<KeyframeId> Covisible(KeyframeId id, int min_shared, int max_num) const;

 private:
  void SetLandmark(const Sighting& sighting, LandmarkId id);

  IdMap<KeyframeId, OdometryKeyframe> keyframes_;
  IdMap<LandmarkId, OdometryLandmark> landmarks_;
};

}  // namespace tessera
