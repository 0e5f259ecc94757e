// Small maps and changes of them: made by hand, or random but valid ones, as a mapper would make them.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <random>

#include "map/map.h"
#include "support/matchers.h"

namespace tessera {

// Keypoints that say nothing.
inline std::shared_ptr<const FeatureFrame> PlainFeatures(int64_t frame, size_t num_keypoints) {
  auto features = std::make_shared<FeatureFrame>();
  features->frame = {frame};
  features->keypoints.resize(num_keypoints);
  features->descriptors.resize(num_keypoints);
  return features;
}

// The delta as the mapper would send it: with the hash that it leads to.
inline MapDelta WithHash(const Map& map, MapDelta delta) {
  delta.number = map.next_delta();
  Map trial = map;
  (void)trial.Apply(delta);
  delta.hash = trial.hash();
  return delta;
}

inline constexpr int kKeypointsPerKeyframe = 40;

inline std::shared_ptr<const FeatureFrame> RandomFeatures(int64_t frame, std::mt19937& generator) {
  std::uniform_real_distribution<float> uniform(0.0F, 400.0F);
  auto features = std::make_shared<FeatureFrame>();
  features->frame = {frame};
  features->utime_us = 100'000 * frame;
  features->calibration = {.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240};
  for (int i = 0; i < kKeypointsPerKeyframe; ++i) {
    features->keypoints.push_back({.x_px = uniform(generator),
                                   .y_px = uniform(generator),
                                   .score = static_cast<uint16_t>(generator() % 1000),
                                   .level = static_cast<uint8_t>(generator() % 8),
                                   .angle = static_cast<uint8_t>(generator() % 256)});
    features->descriptors.push_back({generator(), generator(), generator(), generator()});
  }
  return features;
}

inline Landmark RandomLandmark(std::mt19937& generator) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Landmark landmark;
  landmark.position_in_world = {uniform(generator), uniform(generator), uniform(generator)};
  landmark.normal = Eigen::Vector3d(uniform(generator), uniform(generator), uniform(generator)).normalized();
  landmark.depth_sigma = 1.0 + uniform(generator);
  landmark.min_distance = 1.0 + uniform(generator);
  landmark.max_distance = 3.0 + uniform(generator);
  landmark.descriptor = {generator(), generator(), generator(), generator()};
  return landmark;
}

// The delta, with the hash it leads to, applied to `map`. Each brings a keyframe; from time to time one goes.
inline MapDelta RandomChange(Map& map, std::mt19937& generator) {
  MapDelta delta;
  delta.number = map.next_delta();
  const KeyframeId keyframe{map.keyframes().end_id()};
  delta.answers = keyframe;
  delta.new_keyframes.push_back(
      {keyframe, {keyframe.value - 1}, {}, RandomFeatures(3 * keyframe.value, generator), 2.5});
  const KeyframeId gone{keyframe.value % 5 == 4 ? keyframe.value - 3 : -1};
  int32_t keypoint = 0;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    const bool is_removed = generator() % 10 == 0;
    for (const Observation& observation : map.ObservationsOf(id)) {
      if (is_removed || observation.keyframe == gone) delta.removed_observations.push_back({id, observation});
    }
    if (is_removed) {
      delta.removed_landmarks.push_back(id);
    } else if (keypoint < kKeypointsPerKeyframe / 2 && generator() % 2 == 0) {
      delta.new_observations.push_back({id, {keyframe, keypoint++}});
    }
  });
  for (int i = 0; i < 10; ++i) {
    const LandmarkId id{map.landmarks().end_id() + i};
    delta.changed_landmarks.push_back({id, RandomLandmark(generator)});
    delta.new_observations.push_back({id, {keyframe, keypoint++}});
  }
  if (gone.valid()) {
    delta.changed_parents.push_back({{gone.value + 1}, map.FindKeyframe(gone)->parent});
    delta.removed_keyframes.push_back(gone);
  }
  if (keyframe.value > 0) {
    const auto shift = static_cast<double>(generator() % 100);
    delta.moved_keyframes.push_back(
        {{keyframe.value - 1}, {Eigen::Quaterniond::Identity(), {shift, 0, 0}}, 1.0 + shift});
  }
  if (keyframe.value % 4 == 3) {
    const KeyframeId matched{static_cast<int64_t>(generator()) % keyframe.value};
    delta.closed_loops.push_back({keyframe, matched, 0.5 + 0.01 * static_cast<double>(generator() % 100), 50});
  }
  // The hash is found by trying on a copy, whose complaint about the missing hash is expected.
  Map trial = map;
  EXPECT_THAT(trial.Apply(delta), IsFailure(HasSubstr("wrong hash")));
  delta.hash = trial.hash();
  EXPECT_THAT(map.Apply(delta), IsSuccess());
  return delta;
}

}  // namespace tessera
