#include "tracking/odometry_map.h"

#include <algorithm>
#include <map>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kMaxDescriptors = 8;  // newest sightings that the choice of descriptor looks at

std::vector<Sighting>::iterator SightingIn(OdometryLandmark& landmark, KeyframeId keyframe) {
  return std::find_if(landmark.sightings.begin(), landmark.sightings.end(),
                      [keyframe](const Sighting& s) { return s.keyframe == keyframe; });
}

// The descriptor with the least sum of distances to the others; ties go to the first.
Descriptor Medoid(const std::vector<Descriptor>& descriptors) {
  size_t best = 0;
  int best_sum = -1;
  for (size_t i = 0; i < descriptors.size(); ++i) {
    int sum = 0;
    for (const Descriptor& other : descriptors) {
      sum += HammingDistance(descriptors[i], other);
    }
    if (best_sum < 0 || sum < best_sum) {
      best = i;
      best_sum = sum;
    }
  }
  return descriptors[best];
}

}  // namespace

void OdometryMap::SetLandmark(const Sighting& sighting, LandmarkId id) {
  OdometryKeyframe& keyframe = *keyframes_.Find(sighting.keyframe);
  keyframe.landmarks[static_cast<size_t>(sighting.keypoint)] = id;
}

KeyframeId OdometryMap::AddKeyframe(std::shared_ptr<const FrameView> view, const Rigid3& camera_from_world,
                                    KeyframeId reference, const std::vector<LandmarkId>& landmarks) {
  const KeyframeId id{keyframes_.end_id()};
  OdometryKeyframe& made = keyframes_.Put(id, {});
  made.landmarks.resize(static_cast<size_t>(view->size()));
  made.view = std::move(view);
  made.camera_from_world = camera_from_world;
  made.reference = reference;
  if (reference.valid()) {
    made.reference_from_camera = keyframe(reference).camera_from_world * camera_from_world.Inverse();
  }
  for (size_t i = 0; i < landmarks.size(); ++i) {
    if (landmarks[i].valid()) {
      AddSighting(landmarks[i], {id, static_cast<int32_t>(i)});
    }
  }
  return id;
}

void OdometryMap::RemoveKeyframe(KeyframeId id) {
  const std::vector<LandmarkId> seen = keyframe(id).landmarks;
  for (const LandmarkId landmark_id : seen) {
    if (landmark_id.valid()) {
      RemoveSighting(landmark_id, id);
      if (landmark(landmark_id).sightings.empty()) {
        landmarks_.Remove(landmark_id);
      }
    }
  }
  keyframes_.Remove(id);
}

LandmarkId OdometryMap::AddLandmark(const PointRefinement& point, const std::vector<Sighting>& sightings) {
  const LandmarkId id{landmarks_.end_id()};
  OdometryLandmark& made = landmarks_.Put(id, {});
  made.birth = newest();
  for (const Sighting& sighting : sightings) {
    AddSighting(id, sighting);
  }
  Describe(id, point);
  return id;
}

void OdometryMap::RemoveLandmark(LandmarkId id) {
  for (const Sighting& sighting : landmark(id).sightings) {
    SetLandmark(sighting, LandmarkId{});
  }
  landmarks_.Remove(id);
}

void OdometryMap::AddSighting(LandmarkId id, const Sighting& sighting) {
  std::vector<Sighting>& sightings = landmark(id).sightings;
  const auto place = std::find_if(sightings.begin(), sightings.end(), [&sighting](const Sighting& s) {
    return s.keyframe > sighting.keyframe;
  });
  sightings.insert(place, sighting);
  SetLandmark(sighting, id);
}

void OdometryMap::RemoveSighting(LandmarkId id, KeyframeId keyframe) {
  OdometryLandmark& from = landmark(id);
  const auto sighting = SightingIn(from, keyframe);
  if (sighting != from.sightings.end()) {
    SetLandmark(*sighting, LandmarkId{});
    from.sightings.erase(sighting);
  }
}

void OdometryMap::Merge(LandmarkId removed, LandmarkId kept) {
  const std::vector<Sighting> moved = landmark(removed).sightings;
  landmark(kept).num_expected += landmark(removed).num_expected;
  landmark(kept).num_found += landmark(removed).num_found;
  RemoveLandmark(removed);
  for (const Sighting& sighting : moved) {
    if (!Sees(sighting.keyframe, kept)) {
      AddSighting(kept, sighting);
    }
  }
}

void OdometryMap::Describe(LandmarkId id, const PointRefinement& point) {
  OdometryLandmark& described = landmark(id);
  described.position_in_world = point.point_in_world;
  described.covariance = point.covariance;
  described.normal.setZero();
  std::vector<Descriptor> descriptors;
  for (const Sighting& sighting : described.sightings) {
    const OdometryKeyframe& seer = keyframe(sighting.keyframe);
    const Eigen::Vector3d to_camera = seer.camera_from_world.Inverse().translation - described.position_in_world;
    described.normal += to_camera.normalized();
    described.reach = to_camera.norm() * ScaleOfLevel(seer.view->keypoint(sighting.keypoint).level);
    descriptors.push_back(seer.view->descriptor(sighting.keypoint));
  }
  described.normal.normalize();
  if (descriptors.size() > kMaxDescriptors) {
    descriptors.erase(descriptors.begin(), descriptors.end() - kMaxDescriptors);
  }
  described.descriptor = Medoid(descriptors);
}

bool OdometryMap::Sees(KeyframeId keyframe, LandmarkId id) const {
  const std::vector<Sighting>& sightings = landmark(id).sightings;
  return std::any_of(sightings.begin(), sightings.end(),
                     [keyframe](const Sighting& s) { return s.keyframe == keyframe; });
}

std::vector<PointView> OdometryMap::Views(const std::vector<Sighting>& sightings) const {
  std::vector<PointView> views;
  views.reserve(sightings.size());
  for (const Sighting& sighting : sightings) {
    const OdometryKeyframe& seer = keyframe(sighting.keyframe);
    views.push_back({seer.camera_from_world, seer.view->observation(sighting.keypoint)});
  }
  return views;
}

std::vector<KeyframeId> OdometryMap::Covisible(KeyframeId id, int min_shared, int max_num) const {
  std::map<KeyframeId, int> shared;
  for (const LandmarkId landmark_id : keyframe(id).landmarks) {
    if (landmark_id.valid()) {
      for (const Sighting& sighting : landmark(landmark_id).sightings) {
        ++shared[sighting.keyframe];
      }
    }
  }
  shared.erase(id);
  std::vector<std::pair<int, KeyframeId>> ranked;
  for (const auto& [other, count] : shared) {
    if (count >= min_shared) {
      ranked.emplace_back(count, other);
    }
  }
  std::sort(ranked.rbegin(), ranked.rend());
  ranked.resize(std::min(ranked.size(), static_cast<size_t>(max_num)));
  std::vector<KeyframeId> ids;
  for (const auto& [count, other] : ranked) {
    ids.push_back(other);
  }
  return ids;
}

}  // namespace tessera
