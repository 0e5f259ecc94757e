// Features of one tile: pyramid, corners, orientation, descriptors; the right column (stereo) or depth (RGB-D) of each.
#pragma once

#include <array>
#include <vector>

#include "features/corner_detector.h"
#include "features/descriptor.h"
#include "features/feature_types.h"
#include "features/pyramid.h"
#include "features/smoother.h"
#include "features/stereo_matcher.h"
#include "features/tile_plan.h"

namespace tessera {

// Holds only scratch memory, which is kept from job to job: after the first job of a size nothing but the result is
// allocated. One thread at a time may use it; any number of extractors may work side by side.
class Extractor {
 public:
  // The candidates of the job's tile, a pure function of the job: whatever the cut, the candidates of all tiles
  // together are those of the whole image, up to such as SelectFeatures would not take anyway and such as the job does
  // not want. Throws std::invalid_argument with CheckTileJob's sentence if the job is malformed.
  TileFeatures Extract(const TileJob& job);

 private:
  void BuildPyramids(const TileJob& job);
  void DetectCandidates(const TileJob& job);
  void DescribeCandidates(TileFeatures& features);
  void MatchCandidates(const FeatureOptions& options);

  TilePlan plan_;
  std::array<LevelImage, kMaxLevels> left_;
  std::array<LevelImage, kMaxLevels> right_;
  std::array<LevelImage, kMaxLevels> smoothed_;  // once: corners and orientations are found there
  LevelImage doubly_smoothed_;                   // one level at a time: descriptors compare its pixels
  PyramidReducer reducer_;
  CornerDetector detector_;
  Smoother smoother_;
  StereoMatcher matcher_;
  std::vector<Candidate> candidates_;
  std::vector<LevelCut> cuts_;
};

}  // namespace tessera
