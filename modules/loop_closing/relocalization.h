// Relocalization: where an image was taken, from the map alone.
#pragma once

#include "core/result.h"
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
  int num_neighbors = 15;  // keyframes around the candidate, whose landmarks are searched
  MatchOptions guided{.local_radius_px = 8.0};
  int min_seen = 50;          // landmarks of the place that the image must show
  double min_coverage = 0.4;  // see Coverage()
  // Of the landmarks that it should show. A street with the same cars parked at the same distances shows up to 0.07.
  double min_seen_share = 0.1;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Tries the candidates one after the other: matches by visual words, the pose from three points (RANSAC, seeded by the
// frame's number), then guided matching of all landmarks of the place; the pose must agree with min_seen of them and
// with a tenth of those that it should see, spread over the image. The first place that passes is the answer. As in
// ORB-SLAM (Mur-Artal et al. 2015).
RelocalizationAnswer Relocalize(const Map& map, const PlaceDatabase& places, const Vocabulary& vocabulary,
                                const RelocalizationRequest& request, const CandidateOptions& candidates,
                                const RelocalizationOptions& options);

}  // namespace tessera
