// Place candidates: earlier places that look like the one in a keyframe or an image.
#pragma once

#include <vector>

#include "core/result.h"
#include "map/map.h"
#include "place_recognition/place_database.h"

namespace tessera {

struct CandidateOptions {
  int min_shared_landmarks = 15;  // keyframes that share as many landmarks are neighbors
  int num_neighbors = 10;         // best neighbors of a keyframe, which form a place with it
  double min_group_share = 0.75;  // of the best place's score (Mur-Artal & Tardos 2014)
  int num_consistent = 2;         // previous keyframes that must have the same place among their candidates
  int max_candidates = 5;

  // Fails if a value is out of range.
  Result<> Check() const;
};

struct Candidates {
  std::vector<KeyframeId> keyframes;  // the best one of each consistent place, best place first
  int num_found = 0;                  // places before the test of consistency
};

// Places that look more like keyframe `id` than its least similar neighbor does, that are not connected with it by
// common landmarks, neither directly nor through a neighbor, and that are candidates of the keyframes just before it as
// well: a similarity by chance does not last.
// As in R. Mur-Artal & J. D. Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014, but a
// function of the map and the keyframe alone: nothing is kept from one keyframe to the next.
Candidates FindLoopCandidates(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options);

// Places that look like an image, best first.
std::vector<KeyframeId> FindPlaces(const Map& map, const PlaceDatabase& places, const BagOfWords& bag,
                                   const CandidateOptions& options);

}  // namespace tessera
