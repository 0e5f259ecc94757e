// Matches of keypoints between two frames by descriptor. All are deterministic: ties go to the lower index.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "measurement/frame_view.h"

namespace tessera {

struct Match {
  int32_t first = -1;    // keypoint of the first frame
  int32_t second = -1;   // keypoint of the second frame
  int32_t distance = 0;  // Hamming
};

struct MatchingOptions {
  int max_hamming = 60;        // of 256; the same corner stays mostly below, different ones are about 128 apart
  double max_ratio = 0.8;      // best to second best distance (Lowe 2004)
  bool check_rotation = true;  // drop matches outside the peak of the rotation histogram
};

// Keypoints of `first` in a window of +-radius_px around centers_px (by keypoint of `first`), within one pyramid level.
// Each keypoint of `second` is given to the nearest descriptor only.
std::vector<Match> MatchInWindow(const FrameView& first, std::span<const Eigen::Vector2d> centers_px,
                                 const FrameView& second, double radius_px, const MatchingOptions& options);

// Best and second best candidate so far.
struct BestMatch {
  int32_t index = -1;
  int distance = 257;
  int second_distance = 257;

  void Offer(int32_t candidate, int candidate_distance) {
    if (candidate_distance < distance || (candidate_distance == distance && candidate < index)) {
      second_distance = distance;
      distance = candidate_distance;
      index = candidate;
    } else if (candidate_distance < second_distance) {
      second_distance = candidate_distance;
    }
  }
  bool IsClear(const MatchingOptions& options) const {
    return index >= 0 && distance <= options.max_hamming && distance <= options.max_ratio * second_distance;
  }
};

// Keeps, of matches that share their `second`, the one with the lowest distance (then the lowest `first`).
std::vector<Match> KeepBestPerSecond(std::vector<Match> matches, int num_second);

// Keeps the matches whose rotation, the angle of `second` less that of `first`, is an inlier of the histogram of all,
// if the options ask for it.
std::vector<Match> KeepRotationInliers(std::vector<Match> matches, const FrameView& first, const FrameView& second,
                                       const MatchingOptions& options);

// Marks the rotations (1/256 turn each) in the three neighboring bins, of 32, of their histogram that hold most of
// them: an image rotates as a whole, so wrong matches stand out (ORB-SLAM: Mur-Artal et al. 2015).
std::vector<char> RotationHistogramInliers(std::span<const uint8_t> rotations);

}  // namespace tessera
