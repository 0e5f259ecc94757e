// Cuts frames into jobs for extractors, without loss: the features of the jobs together are those of the whole frame.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "features/feature_types.h"
#include "geometry/camera_frame.h"

namespace tessera {

struct TileGrid {
  static constexpr int kMaxSide = 64;  // lines or columns

  int lines = 1;
  int columns = 1;

  bool operator==(const TileGrid&) const = default;
};

// "2x3": two lines, three columns. Throws InputError if it isn't two whole numbers from 1 to kMaxSide.
TileGrid ParseTileGrid(const std::string& text);

// The jobs of one frame, num_tiles of them, in the order in which they are best given out: the most work first, so that
// none is left to run alone at the end.
//
// A 1x1 grid makes one job with all levels of the pyramid. Otherwise one job has the coarse levels
// from `coarse_levels_from` up, of the whole image (their margins would be wide in level-0 pixels), which it brings at
// the first of these levels: level 4 has a quarter of the pixels; then each tile of the grid, line by line, has the
// levels below that. Tiles that have nothing to detect are left out.
//
// captured_us is copied into the jobs. Throws InputError if the options, the calibration or the sizes of the images are
// wrong.
std::vector<TileJob> CutFrame(CameraFrame frame, const CameraCalibration& calibration, int64_t captured_us,
                              TileGrid grid, int coarse_levels_from, const FeatureOptions& options);

// What the job costs: the pixels of all its pyramid levels; at least 1.
int64_t WorkOf(const TileJob& job);

// Whether an extractor can work on the job: ranges and sizes are right, and the pixels that the core needs are there.
Result<> CheckTileJob(const TileJob& job);

}  // namespace tessera
