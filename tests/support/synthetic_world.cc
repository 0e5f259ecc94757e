#include "support/synthetic_world.h"

#include <algorithm>
#include <cmath>

#include "map/map_editor.h"
#include "measurement/landmark_description.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

constexpr double kFirstDistance = 25.0;  // at which a point's patch has the size of level 0
constexpr long kTopPictureLevel = 7;

CameraCalibration CalibrationOf(SensorType sensor) {
  CameraCalibration calibration;
  calibration.sensor = sensor;
  calibration.width_px = 960;
  calibration.height_px = 480;
  calibration.fx_px = calibration.fy_px = 500.0;
  calibration.cx_px = 480.0;
  calibration.cy_px = 240.0;
  calibration.baseline_m = sensor == SensorType::kStereo ? 0.5 : 0.0;
  calibration.depth_unit_m = sensor == SensorType::kRgbd ? 0.001 : 0.0;
  return calibration;
}

}  // namespace

SyntheticWorld::SyntheticWorld(SensorType sensor, double noise_px, size_t num_points)
    : calibration_(CalibrationOf(sensor)), noise_px_(noise_px) {
  for (size_t i = 0; i < num_points; ++i) {
    std::uniform_real_distribution<double> side(3.0, 9.0), height(-4.0, 2.0), ahead(0.0, 45.0);
    const double sign = i % 2 == 0 ? 1.0 : -1.0, x = side(generator_), y = height(generator_);
    points_.push_back({sign * x, y, ahead(generator_)});
    descriptors_.push_back({generator_(), generator_(), generator_(), generator_()});
  }
}

Rigid3 SyntheticWorld::Pose(double step) {
  return {ExpSO3({0.0, 0.01 * step, 0.0}), {0.02 * step, 0.01 * std::sin(step), 0.5 * step}};
}

SyntheticWorld::Picture SyntheticWorld::Take(int64_t step, const Rigid3& world_from_camera) {
  Picture picture;
  picture.features.frame = {step};
  picture.features.utime_us = 100000 * step;
  picture.features.calibration = calibration_;
  const Rigid3 camera_from_world = world_from_camera.Inverse();
  std::normal_distribution<double> noise(0.0, noise_px_);
  for (size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d point = camera_from_world * points_[i];
    if (point.z() < 1.0 || point.z() > 20.0) continue;
    const double level = std::log(kFirstDistance / point.norm()) / std::log(1.2);
    Keypoint keypoint;
    keypoint.level = static_cast<uint8_t>(std::clamp(std::lround(level), 0L, kTopPictureLevel));
    const double sigma = noise_px_ > 0.0 ? LevelScale(keypoint.level) : 0.0;
    Eigen::Vector2d pixel = calibration_.Project(point);
    pixel += sigma * Eigen::Vector2d(noise(generator_), noise(generator_));
    if (pixel.x() < 0.0 || pixel.x() >= calibration_.width_px || pixel.y() < 0.0 ||
        pixel.y() >= calibration_.height_px) {
      continue;
    }
    keypoint.x_px = static_cast<float>(pixel.x());
    keypoint.y_px = static_cast<float>(pixel.y());
    if (calibration_.sensor != SensorType::kMono) {
      const double fx_baseline = calibration_.fx_px * Baseline(calibration_);
      const double disparity = fx_baseline / point.z() - sigma * noise(generator_);
      if (calibration_.sensor == SensorType::kStereo) {
        keypoint.right_x_px = static_cast<float>(pixel.x() - disparity);
      } else if (disparity > 0.0) {
        keypoint.depth_m = static_cast<float>(fx_baseline / disparity);
      }
    }
    picture.features.keypoints.push_back(keypoint);
    Descriptor descriptor = descriptors_[i];
    for (int flips = 0; flips < 10; ++flips) descriptor[generator_() % 4] ^= uint64_t{1} << (generator_() % 64);
    picture.features.descriptors.push_back(descriptor);
    picture.points.push_back(i);
  }
  return picture;
}

Landmark SyntheticWorld::LandmarkOf(size_t point, const Rigid3& world_from_camera) const {
  Landmark landmark;
  landmark.position_in_world = points_[point];
  landmark.normal = (world_from_camera.translation - points_[point]).normalized();
  landmark.min_distance = 1.0;
  landmark.max_distance = kFirstDistance;
  landmark.descriptor = descriptors_[point];
  return landmark;
}

SeenPoint SyntheticWorld::Known(size_t point, const Rigid3& world_from_camera) const {
  return {{{static_cast<int64_t>(point)}, {}, -1}, LandmarkOf(point, world_from_camera)};
}

TrackedFrame SyntheticWorld::TrackedAt(int64_t step) {
  const Picture picture = Take(step);
  TrackedFrame frame(ViewOf(picture.features));
  frame.world_from_camera = Pose(static_cast<double>(step));
  for (size_t i = 0; i < picture.points.size(); ++i) {
    frame.points[i] = Known(picture.points[i], frame.world_from_camera);
  }
  return frame;
}

std::shared_ptr<const FrameView> ViewOf(const FeatureFrame& features) {
  return std::make_shared<const FrameView>(features);
}

KeyframeId PlantedMap::Add(int64_t step, KeyframeId parent, int visit, const Sim3& map_from_truth,
                           const std::function<void(FeatureFrame&)>& change) {
  const KeyframeId id{map_.keyframes().end_id()};
  SyntheticWorld::Picture picture = world_.Take(step);
  picture.features.frame = {id.value};
  change(picture.features);
  MapEditor editor(map_);
  const Rigid3 pose = SyntheticWorld::Pose(static_cast<double>(step));
  // The keyframe's units are those of the map where it stands.
  editor.AddKeyframe(id, parent, Sim3::From((map_from_truth * Sim3::From(pose)).Pose()),
                     std::make_shared<const FeatureFrame>(picture.features));
  std::vector<LandmarkId> seen;
  for (size_t i = 0; i < picture.points.size(); ++i) {
    auto [known, is_new] = landmarks_.try_emplace({visit, picture.points[i]});
    if (is_new) {
      known->second = editor.AddLandmark({.position_in_world = map_from_truth * world_.point(picture.points[i])});
    }
    editor.AddObservation(known->second, {id, static_cast<int32_t>(i)});
    seen.push_back(known->second);
  }
  for (const LandmarkId landmark : seen) editor.ChangeLandmark(landmark, DescribeLandmark(map_, landmark));
  deltas_.push_back(editor.Finish(id));
  points_.push_back(picture.points);
  poses_.push_back(pose);
  return id;
}

size_t PlantedMap::PointOf(const Observation& seen) const {
  return points_[static_cast<size_t>(seen.keyframe.value)][static_cast<size_t>(seen.keypoint)];
}

TrackedFrame PlantedMap::FrameOf(KeyframeId id) const {
  const Keyframe& keyframe = *map_.FindKeyframe(id);
  TrackedFrame frame(ViewOf(*keyframe.features));
  frame.world_from_camera = keyframe.world_from_camera;
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const LandmarkId landmark = keyframe.landmarks[i];
    if (landmark.valid()) frame.points[i] = {{landmark, {}, -1}, *map_.FindLandmark(landmark)};
  }
  return frame;
}

int PlantedMap::NumMixed(const Map& map) const {
  int num_mixed = 0;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    const std::span<const Observation> seen = map.ObservationsOf(id);
    num_mixed += std::any_of(seen.begin(), seen.end(),
                             [&](const Observation& o) { return PointOf(o) != PointOf(seen.front()); });
  });
  return num_mixed;
}

double PlantedMap::WorstKeyframe(const Map& map, const Sim3& map_from_truth) const {
  double worst = 0.0;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    worst = std::max(worst, (keyframe.world_from_camera.translation - map_from_truth * Truth(id).translation).norm());
  });
  return worst;
}

double PlantedMap::MedianLandmark(const Map& map, const Sim3& map_from_truth) const {
  std::vector<double> errors;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const size_t point = PointOf(map.ObservationsOf(id).front());
    errors.push_back((landmark.position_in_world - map_from_truth * world_.point(point)).norm());
  });
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

}  // namespace tessera
