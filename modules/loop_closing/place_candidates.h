// Which earlier places look like the one that a keyframe sees.
#pragma once

#include <string>
#include <vector>

#include "map/map.h"
#include "place_recognition/place_database.h"

namespace tessera {

struct CandidateOptions {
  int min_shared_landmarks = 15;  // keyframes that share as many are neighbours; what looks less alike is no candidate
  int num_neighbours = 10;        // best neighbours of a keyframe, which make its place with it
  double min_group_share = 0.75;  // of the best place's score (Mur-Artal & Tardos 2014)
  int num_witnesses = 2;          // keyframes before that must have seen the same place
  int max_candidates = 5;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

struct Candidates {
  std::vector<KeyframeId> keyframes;  // the best one of each place, best place first
  int num_found = 0;                  // before the witnesses were asked
};

// Places that look like keyframe `id`, are not connected with it by common landmarks, neither directly nor through a
// neighbour, and that the keyframes just before it take for candidates as well: what is alike by chance does not last.
// As in R. Mur-Artal & J. D. Tardos, "Fast Relocalisation and Loop Closing in Keyframe-Based SLAM", ICRA 2014, but a
// function of the map and the keyframe alone: nothing is kept from one keyframe to the next.
Candidates FindLoopCandidates(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options);

// Places that look like an image, best first.
std::vector<KeyframeId> FindPlaces(const Map& map, const PlaceDatabase& places, const BagOfWords& bag,
                                   const CandidateOptions& options);

}  // namespace tessera
