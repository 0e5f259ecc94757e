// Whether an earlier place really is what a keyframe sees, and where the keyframe then stands.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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
  int min_matches = 20;          // landmarks that both keyframes see, by their descriptors
  SimilarityOptions similarity;  // has_scale and baseline_m follow from the camera
  // Then the place's landmarks are looked for around where the keyframe should see them.
  int num_neighbours = 15;  // of the place, whose landmarks belong to it
  MatchOptions guided{.local_radius_px = 6.0, .max_hamming = 64};
  int min_seen = 45;          // of the place's landmarks that the keyframe must see
  double min_coverage = 0.4;  // see Coverage(): true places have 0.75 and more, the same car elsewhere up to 0.25
  double sigma_px = kKeypointSigmaPx;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

struct VerifiedPlace {
  KeyframeId matched;
  Sim3 matched_from_current;       // scale 1 but for mono
  std::vector<SeenLandmark> seen;  // landmarks of the place that the current keyframe sees, by keypoint
};

// How far a candidate came.
struct VerificationSteps {
  bool is_matched = false;
  bool is_aligned = false;
};

// The similarity between the two keyframes comes from landmarks that both see (Sim(3) for mono, SE(3) otherwise); then
// all landmarks of the place are projected into the current keyframe, whose pose must agree with min_seen of them, all
// over the image. Rotation and translation are those of that pose, the scale is the similarity's. nullopt if a step
// fails.
std::optional<VerifiedPlace> VerifyPlace(const Map& map, const PlaceDatabase& places, KeyframeId current,
                                         KeyframeId candidate, const VerificationOptions& options,
                                         VerificationSteps* steps);

// The landmarks that the keyframe and its neighbours see, by id.
PlacedPoints LandmarksAround(const Map& map, KeyframeId id, int num_neighbours);

// Looks for the points from where `frame` stands, and moves it to where it agrees with most of them. Points that do not
// agree are taken off. Returns how many are left.
int PlaceAmong(const PlacedPoints& points, const MatchOptions& matching, const PoseOptimizationOptions& pose,
               TrackedFrame& frame);

// Of the parts of the image in which the frame, from where it stands, should see several of the points: the share in
// which it sees one. A thing that is found in two places, such as a parked car of the same make, agrees with a pose as
// well as a place does; but what stands around the thing is not seen then.
double Coverage(const PlacedPoints& points, const TrackedFrame& frame);

}  // namespace tessera
