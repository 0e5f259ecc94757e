// The choice of an image's keypoints from the candidates of all its tiles.
#pragma once

#include <span>
#include <string>
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
std::vector<uint32_t> ChooseCandidates(const CameraCalibration& calibration, const FeatureOptions& options,
                                       std::span<const Candidate> candidates);

// The features of one image from the answers to all jobs of CutFrame, in any order; each must be well formed
// (CheckTileFeatures) and the list not empty.
FeatureFrame SelectFeatures(const std::vector<TileFeatures>& tiles);

// Whether all values are in range. To be asked before SelectFeatures where the value came from outside.
Result<> CheckTileFeatures(const TileFeatures& features);

}  // namespace tessera
