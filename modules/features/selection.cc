#include "features/selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <tuple>

#include "features/pyramid.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

// One candidate during the choice.
struct Entry {
  uint32_t index = 0;
  uint32_t cell = 0;      // counted along the rows of the level's grid
  uint32_t priority = 0;  // score, then score * weight
  int16_t x = 0;
  int16_t y = 0;
  uint8_t level = 0;
};

// 2^12 * weight[rank], weight[rank] = 1 / (1 + rank / 16). Strong corners are found again more surely than spread ones:
// steeper weights would leave fewer keypoints repeatable than cv::ORB has.
uint32_t RankWeight(uint32_t rank) {
  constexpr uint32_t kHalfWeightRank = 16;
  return (kHalfWeightRank << 12U) / (kHalfWeightRank + rank);
}

bool IsBefore(const Entry& a, const Entry& b) {
  return std::tie(a.level, a.y, a.x, a.index) < std::tie(b.level, b.y, b.x, b.index);
}
bool IsSamePlace(const Entry& a, const Entry& b) { return a.level == b.level && a.y == b.y && a.x == b.x; }

uint32_t CellOf(const CameraCalibration& calibration, const Candidate& candidate) {
  const int num_columns = CellAxis(LevelSize(calibration.width_px, candidate.level)).num_cells();
  const int column = (candidate.x - kBorderPx) / kCellPx;
  const int row = (candidate.y - kBorderPx) / kCellPx;
  return static_cast<uint32_t>(row * num_columns + column);
}

// Distinct candidates in the order (level, y, x).
std::vector<Entry> SortedEntries(const CameraCalibration& calibration, std::span<const Candidate> candidates) {
  std::vector<Entry> entries;
  entries.reserve(candidates.size());
  for (size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& candidate = candidates[i];
    entries.push_back({.index = static_cast<uint32_t>(i),
                       .cell = CellOf(calibration, candidate),
                       .priority = candidate.score,
                       .x = candidate.x,
                       .y = candidate.y,
                       .level = candidate.level});
  }
  std::sort(entries.begin(), entries.end(), IsBefore);
  entries.erase(std::unique(entries.begin(), entries.end(), IsSamePlace), entries.end());
  return entries;
}

// Turns the scores of one level into priorities.
void WeighByRank(std::span<Entry> level) {
  std::sort(level.begin(), level.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.cell, b.priority, a.y, a.x) < std::tie(b.cell, a.priority, b.y, b.x);
  });
  for (size_t i = 0, first_of_cell = 0; i < level.size(); ++i) {
    if (level[i].cell != level[first_of_cell].cell) first_of_cell = i;
    level[i].priority *= RankWeight(static_cast<uint32_t>(i - first_of_cell));
  }
}

// How many of each level are taken.
std::array<size_t, kMaxLevels> ShareOut(const FeatureOptions& options,
                                        const std::array<size_t, kMaxLevels>& available) {
  const std::array<int, kMaxLevels> quotas = LevelQuotas(options);
  std::array<size_t, kMaxLevels> taken{};
  auto rest = static_cast<size_t>(options.num_features);
  for (size_t level = 0; level < taken.size(); ++level) {
    taken[level] = std::min(available[level], static_cast<size_t>(quotas[level]));
    rest -= taken[level];
  }
  for (size_t level = 0; level < taken.size(); ++level) {
    const size_t more = std::min(rest, available[level] - taken[level]);
    taken[level] += more;
    rest -= more;
  }
  return taken;
}

// The entries of one level, moved so that the `count` best come first.
void PutBestFirst(std::span<Entry> level, size_t count) {
  if (count >= level.size()) return;
  WeighByRank(level);
  std::nth_element(
      level.begin(), level.begin() + static_cast<ptrdiff_t>(count), level.end(),
      [](const Entry& a, const Entry& b) { return std::tie(b.priority, a.y, a.x) < std::tie(a.priority, b.y, b.x); });
}

Keypoint MakeKeypoint(const Candidate& candidate) {
  const auto position = [&candidate](int16_t pixel, int8_t offset) {
    return LevelZeroPosition(pixel + static_cast<double>(offset) / kCornerSubpixels, candidate.level);
  };
  return {.x_px = position(candidate.x, candidate.offset_x),
          .y_px = position(candidate.y, candidate.offset_y),
          .right_x_px = candidate.right_x_px,
          .depth_m = candidate.depth_m,
          .score = candidate.score,
          .level = candidate.level,
          .angle = candidate.angle};
}

}  // namespace

std::vector<uint32_t> ChooseCandidates(const CameraCalibration& calibration, const FeatureOptions& options,
                                       std::span<const Candidate> candidates) {
  std::vector<Entry> entries = SortedEntries(calibration, candidates);
  std::array<size_t, kMaxLevels> available{};
  for (const Entry& entry : entries) ++available[entry.level];
  const std::array<size_t, kMaxLevels> taken = ShareOut(options, available);

  std::vector<Entry> chosen;
  chosen.reserve(static_cast<size_t>(options.num_features));
  size_t first = 0;
  for (size_t level = 0; level < taken.size(); first += available[level], ++level) {
    const std::span<Entry> entries_of_level(entries.data() + first, available[level]);
    PutBestFirst(entries_of_level, taken[level]);
    chosen.insert(chosen.end(), entries_of_level.begin(),
                  entries_of_level.begin() + static_cast<ptrdiff_t>(taken[level]));
  }
  std::sort(chosen.begin(), chosen.end(), IsBefore);
  std::vector<uint32_t> indices;
  indices.reserve(chosen.size());
  for (const Entry& entry : chosen) indices.push_back(entry.index);
  return indices;
}

FeatureFrame SelectFeatures(const std::vector<TileFeatures>& tiles) {
  std::vector<const TileFeatures*> ordered;
  for (const TileFeatures& tile : tiles) ordered.push_back(&tile);
  std::sort(ordered.begin(), ordered.end(), [](const auto* a, const auto* b) { return a->tile < b->tile; });
  std::vector<Candidate> candidates;
  std::vector<const Descriptor*> descriptors;
  for (const TileFeatures* tile : ordered) {
    candidates.insert(candidates.end(), tile->candidates.begin(), tile->candidates.end());
    for (const Descriptor& descriptor : tile->descriptors) descriptors.push_back(&descriptor);
  }
  const TileFeatures& first = *ordered.front();
  FeatureFrame frame{.frame = first.frame,
                     .utime_us = first.utime_us,
                     .captured_us = first.captured_us,
                     .calibration = first.calibration,
                     .keypoints = {},
                     .descriptors = {}};
  for (const uint32_t index : ChooseCandidates(first.calibration, first.options, candidates)) {
    frame.keypoints.push_back(MakeKeypoint(candidates[index]));
    frame.descriptors.push_back(*descriptors[index]);
  }
  return frame;
}

Result<> CheckTileFeatures(const TileFeatures& features) {
  const std::string name = "the features of tile " + std::to_string(features.tile) + " of frame " +
                           std::to_string(features.frame.value) + ": ";
  if (!features.frame.valid()) return Failed(name + "the frame number is negative");
  if (features.num_tiles < 1 || features.tile < 0 || features.tile >= features.num_tiles) {
    return Failed(name + "there are " + std::to_string(features.num_tiles) + " tiles");
  }
  for (const Result<>& checked : {features.calibration.Check(), features.options.Check()}) {
    if (!checked) return Failed(name + checked.error().sentence);
  }
  if (features.descriptors.size() != features.candidates.size()) {
    return Failed(name + std::to_string(features.candidates.size()) + " candidates have " +
                  std::to_string(features.descriptors.size()) + " descriptors");
  }
  for (const Candidate& candidate : features.candidates) {
    if (candidate.level >= features.options.num_levels) {
      return Failed(name + "a candidate's level " + std::to_string(candidate.level) + " does not exist");
    }
    const int width = LevelSize(features.calibration.width_px, candidate.level);
    const int height = LevelSize(features.calibration.height_px, candidate.level);
    if (candidate.x < kBorderPx || candidate.y < kBorderPx || candidate.x >= width - kBorderPx ||
        candidate.y >= height - kBorderPx) {
      return Failed(name + "a candidate lies outside its level's image");
    }
    if (2 * std::abs(candidate.offset_x) > kCornerSubpixels || 2 * std::abs(candidate.offset_y) > kCornerSubpixels) {
      return Failed(name + "a candidate's corner lies outside its pixel");
    }
    if (!std::isfinite(candidate.right_x_px) ||
        candidate.right_x_px >= static_cast<float>(features.calibration.width_px) ||
        !std::isfinite(candidate.depth_m) || candidate.depth_m < 0.0F) {
      return Failed(name + "a candidate's right column or depth is out of range");
    }
  }
  return {};
}

}  // namespace tessera
