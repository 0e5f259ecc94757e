// Place verification: whether a keyframe really shows an earlier place, and from where.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/result.h"
#include "geometry/pose_optimization.h"
#include "geometry/similarity.h"
#include "map/map.h"
#include "matching/bag_matching.h"
#include "matching/point_matching.h"
#include "messages/loop_types.h"
#include "place_recognition/place_database.h"

namespace tessera {

struct VerificationOptions {
  BagMatchingOptions matching;
  int min_matches = 20;          // landmarks that both keyframes observe, matched by their descriptors
  SimilarityOptions similarity;  // has_scale and baseline_m follow from the camera
  // Guided matching: the place's landmarks are searched around their projections.
  int num_neighbors = 15;  // keyframes around the candidate, whose landmarks belong to the place
  MatchOptions guided{.local_radius_px = 6.0, .max_hamming = 64};
  int min_seen = 45;          // landmarks of the place that the keyframe must observe
  double min_coverage = 0.4;  // see Coverage(): true places have 0.75 and more, the same car elsewhere up to 0.25

  // Fails if a value is out of range.
  Result<> Check() const;
};

struct VerifiedPlace {
  KeyframeId matched;
  Sim3 matched_from_current;       // scale 1 but for mono
  std::vector<SeenLandmark> seen;  // landmarks of the place that the current keyframe observes, by keypoint
  double seen_share = 1.0;         // of those that it should see
};

// The steps that a candidate passed.
struct VerificationSteps {
  bool is_matched = false;
  bool is_aligned = false;
};

// The similarity between the two keyframes is estimated from landmarks that both observe (Sim(3) for mono, SE(3)
// otherwise); then all landmarks of the place are projected into the current keyframe, whose pose must agree with
// min_seen of them, spread over the image. Rotation and translation are those of that pose, the scale is the
// similarity's. nullopt if a step fails.
std::optional<VerifiedPlace> VerifyPlace(const Map& map, const PlaceDatabase& places, KeyframeId current,
                                         KeyframeId candidate, const VerificationOptions& options,
                                         VerificationSteps* steps);

// The landmarks that the keyframe and its neighbors observe, by id.
KnownPoints LandmarksAround(const Map& map, KeyframeId id, int num_neighbors);

// Guided matching of the points from the pose of `frame`, then pose optimization with the matches found; outliers are
// removed. Returns the number of matches left.
int LocalizeAmong(const KnownPoints& points, const MatchOptions& matching, const PoseOptimizationOptions& pose,
                  TrackedFrame& frame);

}  // namespace tessera
