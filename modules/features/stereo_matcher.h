// Match of a keypoint along its row in the rectified right image.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "features/pyramid.h"

namespace tessera {

struct StereoMatch {
  int position = 0;  // in the right image, 1/64 px of the level
  int cost = 0;      // of the window
};

class StereoMatcher {
 public:
  static constexpr int kSubpixels = 64;  // positions are counted in 1/64 px

  // Where the pixel (x, y) of the left image is seen in the row right_y of the right image, at most max_disparity
  // to the left of x; nullopt if no position matches well, more than one does, or the best one has a better neighbor
  // farther to the left than is searched. Compares windows of 11 x 11 px by
  //
  //   cost(p) = sum over the window of min(|left(x + i, y + j) - right(p + i, right_y + j) - difference(p)|, 23)
  //   difference(p) = mean of the left window - mean of the right one
  //
  // so that single pixels that differ much (occlusions, highlights) weigh no more than others, and the brightness of
  // the two images doesn't matter (each has its exposure, its lens is darker at the edges). Between pixels the position
  // follows from the costs of its neighbors, and from one step on the intensities.
  // The left image must hold kStereoRadiusPx around (x, y), the right one around the row what LevelPlan::right says.
  std::optional<StereoMatch> Match(const LevelImage& left, const LevelImage& right, int x, int y, int right_y,
                                   int max_disparity);

 private:
  void ComputeCosts(const LevelImage& left, const LevelImage& right, int x, int y, int right_y, int first, int count);
  void ComputeDifferences(const LevelImage& left, const LevelImage& right, int x, int y, int right_y, int first,
                          int count);

  static constexpr size_t kMaxPositions = 1120;
  std::array<uint16_t, kMaxPositions> costs_;  // of the positions first, first + 1, ... of the right image
  std::array<uint8_t, kMaxPositions> brighter_{}, darker_{};  // by how much the left window is, at these positions
};

}  // namespace tessera
