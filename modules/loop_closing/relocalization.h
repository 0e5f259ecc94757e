// Where an image was taken, with nothing to go by but the map.
#pragma once

#include <string>

#include "geometry/absolute_pose.h"
#include "loop_closing/place_candidates.h"
#include "map/map.h"
#include "matching/bag_matching.h"
#include "matching/point_matching.h"
#include "messages/loop_types.h"
#include "place_recognition/place_database.h"
#include "place_recognition/vocabulary.h"

namespace tessera {

struct RelocalizationOptions {
  BagMatchingOptions matching{.max_hamming = 60};
  int min_matches = 15;  // of the image's keypoints with landmarks of a keyframe
  AbsolutePoseOptions pose;
  int num_neighbours = 15;  // of the place, whose landmarks are then looked for
  MatchOptions guided{.local_radius_px = 8.0};
  int min_seen = 50;          // of the place's landmarks that the image must show
  double min_coverage = 0.4;  // and its share of the image, see Coverage()
  double sigma_px = kKeypointSigmaPx;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

// Asks the places that look alike one after the other: matches by the vocabulary's words, the pose of three points
// (RANSAC, seeded by the frame's number), then all landmarks of the place around that pose, which must agree with
// min_seen of them, all over the image. The first place that does is the answer. As in ORB-SLAM (Mur-Artal et al.
// 2015).
RelocalizationAnswer Relocalize(const Map& map, const PlaceDatabase& places, const Vocabulary& vocabulary,
                                const RelocalizationRequest& request, const CandidateOptions& candidates,
                                const RelocalizationOptions& options);

}  // namespace tessera
