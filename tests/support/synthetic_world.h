// One world with known truth for the tests of tracking, mapping and loop closing: a camera that drives forward past
// points on both sides, the features that it would extract, and maps that are put together from them by hand.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "features/feature_types.h"
#include "geometry/rigid3.h"
#include "map/map.h"
#include "matching/point_matching.h"
#include "measurement/frame_view.h"

namespace tessera {

class SyntheticWorld {
 public:
  explicit SyntheticWorld(SensorType sensor, double noise_px = 0.0, size_t num_points = 1500);

  const CameraCalibration& calibration() const { return calibration_; }
  const Eigen::Vector3d& point(size_t i) const { return points_[i]; }
  size_t num_points() const { return points_.size(); }

  // True world_from_camera at a step: half a meter forward each, on a slight bend.
  static Rigid3 Pose(double step);

  struct Picture {
    FeatureFrame features;
    std::vector<size_t> points;  // by keypoint: the point that it shows
  };

  // What the camera extracts at a step: keypoints in the order of points, with the descriptors of their points but for
  // about 10 bits. A point's patch covers 0.1 m.
  Picture Take(int64_t step) { return Take(step, Pose(static_cast<double>(step))); }
  // The same from any pose; `step` numbers the frame.
  Picture Take(int64_t step, const Rigid3& world_from_camera);

  // The point as a map knows it that saw it from `world_from_camera`; exact.
  Landmark LandmarkOf(size_t point, const Rigid3& world_from_camera) const;
  // Point i under the name of landmark i.
  SeenPoint Known(size_t point, const Rigid3& world_from_camera) const;
  // The frame of a picture at its true pose, that sees every point that it shows.
  TrackedFrame TrackedAt(int64_t step);

 private:
  CameraCalibration calibration_;
  double noise_px_;
  std::mt19937_64 generator_{7};
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
};

// A picture made ready for matching, as the tracker does it.
std::shared_ptr<const FrameView> ViewOf(const FeatureFrame& features);

// A map of a SyntheticWorld: what every keypoint shows is known, and so is the drift of each keyframe.
class PlantedMap {
 public:
  explicit PlantedMap(SyntheticWorld& world) : world_(world) {}

  // The next keyframe takes a picture at a step of the world. The map holds it, and the points that no keyframe of this
  // visit has seen yet, where `map_from_truth` puts them: two visits know the same points under different names.
  // `change`: done to the picture first.
  KeyframeId Add(
      int64_t step, KeyframeId parent, int visit = 0, const Sim3& map_from_truth = {},
      const std::function<void(FeatureFrame&)>& change = [](FeatureFrame&) {});

  Map& map() { return map_; }
  const Map& map() const { return map_; }
  // That made the map, one a keyframe.
  const std::vector<MapDelta>& deltas() const { return deltas_; }
  size_t PointOf(const Observation& seen) const;
  // The frame of a keyframe, at its pose in the map, that sees all landmarks of it.
  TrackedFrame FrameOf(KeyframeId id) const;
  const Rigid3& Truth(KeyframeId id) const { return poses_[static_cast<size_t>(id.value)]; }
  // matched_from_current as it is in truth.
  Rigid3 Between(KeyframeId matched, KeyframeId current) const { return Truth(matched).Inverse() * Truth(current); }

  // Landmarks of which keyframes see different points.
  int NumMixed(const Map& map) const;
  // The greatest distance of a keyframe from the truth, once `map_from_truth` is taken off.
  double WorstKeyframe(const Map& map, const Sim3& map_from_truth = {}) const;
  // Median distance of landmarks from the truth.
  double MedianLandmark(const Map& map, const Sim3& map_from_truth = {}) const;

 private:
  SyntheticWorld& world_;
  Map map_;
  std::map<std::pair<int, size_t>, LandmarkId> landmarks_;  // by visit and point
  std::vector<std::vector<size_t>> points_;                 // by keyframe and keypoint
  std::vector<Rigid3> poses_;
  std::vector<MapDelta> deltas_;
};

}  // namespace tessera
