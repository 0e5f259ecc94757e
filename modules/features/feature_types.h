// The values that extraction exchanges: jobs (what an extractor gets), candidates (what it returns), and the
// features of a whole image (what tracking sees; nothing of the cutting is left in them).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/ids.h"
#include "core/image.h"
#include "core/result.h"
#include "geometry/camera.h"

namespace tessera {

inline constexpr int kMaxLevels = 12;  // of a pyramid: 1.2^11 = 7.4
inline constexpr int kNumLevels = 8;   // of the pyramids that maps are made from
inline constexpr int kTopLevel = kNumLevels - 1;

// What decides the features of an image. Carried in every job, so that all extractors of a pool, and several robots
// that share it, need no configuration of their own.
struct FeatureOptions {
  static constexpr int kMaxFeatures = 50000;
  static constexpr int kMaxScore = 254;
  static constexpr int kMaxDisparityPx = 1024;

  int num_features = 2000;      // keypoints per image after selection
  int num_levels = kNumLevels;  // pyramid levels; each is 5/6 of the one below in both directions (scale 1.2)
  int min_score = 4;            // lowest corner score (FAST: intensity difference, 0..255) that counts
  int max_disparity_px = 128;   // stereo: widest search along the row, in level-0 pixels

  bool operator==(const FeatureOptions&) const = default;
  Result<> Check() const;
};

using Descriptor = std::array<uint64_t, 4>;  // 256 binary tests; compare by Hamming distance

// Number of differing bits, 0..256.
inline int HammingDistance(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    distance += __builtin_popcountll(a[i] ^ b[i]);
  }
  return distance;
}

struct Keypoint {
  float x_px = 0.0F;  // position in the (left) image, level-0 pixels
  float y_px = 0.0F;
  float right_x_px = -1.0F;  // stereo: column of the match in the right image, level-0 pixels; < 0: no match
  float depth_m = 0.0F;      // RGB-D: depth (z) at the keypoint; 0: unknown
  uint16_t score = 0;        // strength; higher is better
  uint8_t level = 0;         // pyramid level; one pixel there is 1.2^level pixels here
  uint8_t angle = 0;         // orientation in 1/256 turn, from +x (right) towards +y (down)

  bool operator==(const Keypoint&) const = default;
};

// On the image or, moved there because a rolling shutter saw it late or early, beside it by up to half its size.
inline bool IsNearImage(const Keypoint& keypoint, const CameraCalibration& camera) {
  const double margin_x_px = 0.5 * camera.width_px, margin_y_px = 0.5 * camera.height_px;
  const auto x_px = static_cast<double>(keypoint.x_px), y_px = static_cast<double>(keypoint.y_px);
  return x_px >= -margin_x_px && x_px <= camera.width_px + margin_x_px && y_px >= -margin_y_px &&
         y_px <= camera.height_px + margin_y_px;
}

// The features of one image: keypoints[i] belongs to descriptors[i]; order fixed by (level, y, x).
struct FeatureFrame {
  FrameId frame;
  int64_t utime_us = 0;        // when the image was taken
  int64_t captured_us = 0;     // the same by the host's wall clock; for measuring only
  int64_t depth_delay_us = 0;  // RGB-D: by how much later the depths were taken, as far as the source knows
  CameraCalibration calibration;
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;
};

// What the camera saw, with this correction of its lens: keypoints and right columns stand where they would have been
// seen if the calibration were right, and the calibration says so. Itself where none is known.
FeatureFrame WithLens(FeatureFrame features, const LensCorrection& lens);

// One unit of work: detect and describe the candidates of one tile, over a range of pyramid levels.
struct TileJob {
  int64_t run =
      0;  // start of the reassembler that awaits the answer: copied into it, so that it is known as this run's
  FrameId frame;
  FrameId previous_frame;  // the frame before it that was not dropped; invalid: it is the first
  int64_t utime_us = 0;
  int64_t captured_us = 0;
  int64_t depth_delay_us = 0;
  int32_t tile = 0;       // 0 .. num_tiles - 1
  int32_t num_tiles = 1;  // jobs that make up this frame
  CameraCalibration calibration;
  FeatureOptions options;
  int32_t first_level = 0;  // levels first_level .. last_level are to be extracted
  int32_t last_level = 0;
  Rect core;         // level-0 rectangle that the tile owns: it answers for the cells whose center lies in it
  Rect left_rect;    // pixels of first_level in `left`: those of the core and the margins it needs
  GrayImage left;    // left_rect of the left image
  Rect right_rect;   // stereo: pixels of first_level in `right`
  GrayImage right;   // stereo: right_rect of the right image
  Rect depth_rect;   // RGB-D: level-0 pixels in `depth`
  DepthImage depth;  // RGB-D: depth_rect of the depth image
  // By level: candidates of a lower priority (selection.h) need not be sent; empty: all are wanted. Guessed from frames
  // before, for less to compute and to send; it never changes which features come out.
  std::vector<int32_t> min_priority;
  GrayImage packed;  // a row of bytes on the way to another machine (tile_packing.h): the images come in it alone

  bool operator==(const TileJob&) const = default;
};

inline constexpr int kCornerSubpixels = 64;

// A keypoint that may be selected.
struct Candidate {
  int16_t x = 0;  // pixel of its pyramid level, in coordinates of the whole level image
  int16_t y = 0;
  int8_t offset_x = 0;  // from there to the corner, 1/kCornerSubpixels px of its level, half a pixel at most
  int8_t offset_y = 0;
  uint8_t level = 0;
  uint8_t angle = 0;         // 1/256 turn
  uint16_t score = 0;        // strength
  float right_x_px = -1.0F;  // as in Keypoint
  float depth_m = 0.0F;

  bool operator==(const Candidate&) const = default;
};

// Of the candidates of one level, those below min_priority were not sent.
struct LevelCut {
  int32_t min_priority = 0;
  int32_t num_found = 0;  // with those that were not sent

  bool operator==(const LevelCut&) const = default;
};

// The answer to a TileJob: candidates[i] belongs to descriptors[i].
struct TileFeatures {
  int64_t run = 0;  // as in TileJob
  FrameId frame;
  FrameId previous_frame;  // as in TileJob: the order in which frames are released
  int64_t utime_us = 0;
  int64_t captured_us = 0;
  int64_t depth_delay_us = 0;
  int32_t tile = 0;
  int32_t num_tiles = 1;
  CameraCalibration calibration;
  FeatureOptions options;
  std::vector<LevelCut> cuts;  // by level; empty: all candidates are here
  std::vector<Candidate> candidates;
  std::vector<Descriptor> descriptors;

  bool operator==(const TileFeatures&) const = default;
};

}  // namespace tessera
