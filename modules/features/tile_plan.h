// Which cells a tile answers for, and which pixels it needs for that: what dispatcher and extractor agree
// on.
//
// Each level of the pyramid carries a fixed grid of cells over the pixels that are far enough from the image's border
// to be described. A cell belongs to the tile whose core holds its center (in level-0 coordinates). Rectangles are
// products of an interval along x and one along y, so both axes are planned alike.
#pragma once

#include <array>

#include "core/image.h"
#include "features/feature_types.h"
#include "features/pyramid.h"

namespace tessera {

// Side of a cell, pixels of its level.
inline constexpr int kCellPx = 32;
// A keypoint and its cell see this far: 15 px of the rotated pattern (or of the orientation's disc) and 3 px of blur.
// The ring of the corner test (3 px) and its neighbors (1 px) lie within.
inline constexpr int kPatchRadiusPx = 15;
inline constexpr int kBlurRadiusPx = 3;
inline constexpr int kBorderPx = kPatchRadiusPx + kBlurRadiusPx;
// Stereo: half the side of the window that is compared, plus one pixel for the subpixel step.
inline constexpr int kStereoRadiusPx = 5;
inline constexpr int kStereoMarginPx = kStereoRadiusPx + 1;

// The grid of cells along one axis of a level.
struct CellAxis {
  explicit CellAxis(int level_size_px) : level_size(level_size_px) {}

  int num_cells() const {
    return level_size > 2 * kBorderPx ? (level_size - 2 * kBorderPx + kCellPx - 1) / kCellPx : 0;
  }
  // Pixels of cells first .. last - 1; the last cell of the grid may be narrower.
  Interval Pixels(Interval cells) const;
  // Cells whose center lies in `core`, level-0 pixels.
  Interval CellsOf(Interval core, int level) const;

  int level_size;
};

// Widest disparity that is searched at a level, pixels of the level.
int LevelDisparity(const FeatureOptions& options, int level);

struct LevelPlan {
  int width = 0;  // of the whole level, px
  int height = 0;
  Interval cell_columns;  // the cells that the tile answers for
  Interval cell_rows;
  Rect corners;  // their pixels
  Rect left;     // pixels of the level that are needed for them and for the levels above
  Rect right;    // stereo: likewise of the right image
};

struct TilePlan {
  std::array<LevelPlan, kMaxLevels> levels;  // those from the tile's first to its last level are set
  Rect depth;                                // RGB-D: level-0 pixels at which depth may be read

  bool HasCells() const;
};

// `core` is a level-0 rectangle inside the image; the levels must be in range of the options. The pixels that a job
// brings are those of its first level: the levels below are of no use to it.
TilePlan PlanTile(const CameraCalibration& calibration, const FeatureOptions& options, const Rect& core,
                  int first_level, int last_level);

// How many of the num_features keypoints each level gets: in proportion to (5/6)^level, as in ORB-SLAM (Mur-Artal
// 2015).
std::array<int, kMaxLevels> LevelQuotas(const FeatureOptions& options);

// How many candidates a cell of this level may yield.
int CellCapacity(const FeatureOptions& options, int level, int level_width, int level_height);

}  // namespace tessera
