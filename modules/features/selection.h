// The choice of an image's keypoints from the candidates of all its tiles.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "features/feature_types.h"

namespace tessera {

// Indices of the candidates that become keypoints, options.num_features at most, in the order (level, y, x); of
// candidates at the same position, the first is taken. A pure function of the set of candidates.
//
// Each level has a quota (LevelQuotas); what a level can't fill goes to the others, finest first. Within a level the
// candidates with the highest priority are taken (ties by y, then x):
//
//   priority = score * weight[rank],
//
// where the rank counts the better candidates of the same cell, and the falling weights spread the keypoints.
// Choosing again among the chosen ones changes nothing, so an extractor that has a whole image may choose beforehand.
// A cell belongs to one tile, so the extractor of a tile knows the priorities of its candidates, too. What it leaves
// out below a guess of the lowest priority that is chosen does no harm if, with the number of all candidates of the
// level,
//
//   number of those sent that have the highest of the tiles' guesses or more >= number taken of the level
//
// since all that was left out comes behind them: then the choice is that from all candidates. Otherwise all are needed.
std::vector<uint32_t> ChooseCandidates(const CameraCalibration& calibration, const FeatureOptions& options,
                                       std::span<const Candidate> candidates);

// Removes the candidates of a tile whose priority is below `min_priority` of their level; the others keep their order.
// Returns what was there.
std::vector<LevelCut> LeaveOutBelow(const std::vector<int32_t>& min_priority, const CameraCalibration& calibration,
                                    std::vector<Candidate>& candidates);

struct Selection {
  FeatureFrame features;
  std::vector<int32_t> lowest_priority;  // that was chosen, by level; 0: all of the level were
};

// The features of one image from the answers to all jobs of CutFrame, in any order; each must be well formed
// (CheckTileFeatures) and the list not empty. nullopt: what was left out of them may be needed.
std::optional<Selection> SelectFeatures(const std::vector<TileFeatures>& tiles);

// Whether all values are in range. To be asked before SelectFeatures where the value came from outside.
Result<> CheckTileFeatures(const TileFeatures& features);

}  // namespace tessera
