#include "features/selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numeric>
#include <utility>

#include "features/pyramid.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

// One candidate during the choice.
struct Entry {
  uint32_t index = 0;
  uint32_t cell = 0;      // counted along the rows of the level's grid
  uint32_t priority = 0;  // score, then score * weight
};

// Where a candidate stands.
struct Spot {
  uint32_t index = 0;  // the candidate's
  uint16_t x = 0;
  uint16_t y = 0;
  uint8_t level = 0;
};

// 2^12 * weight[rank], weight[rank] = 1 / (1 + rank / 16). Strong corners are found again more surely than spread ones:
// steeper weights would leave fewer keypoints repeatable than cv::ORB has.
uint32_t RankWeight(uint32_t rank) {
  constexpr uint32_t kHalfWeightRank = 16;
  return (kHalfWeightRank << 12U) / (kHalfWeightRank + rank);
}

bool IsSamePlace(const Spot& a, const Spot& b) { return a.level == b.level && a.y == b.y && a.x == b.x; }

// Sorts by a small whole number, key_of(item), in linear time. Those with equal keys keep their order: sorting by the
// least important key first sorts by several.
template <class Item, class KeyOf>
void SortByKey(std::vector<Item>& items, KeyOf key_of) {
  uint32_t num_keys = 0;
  for (const Item& item : items) num_keys = std::max(num_keys, uint32_t{key_of(item)} + 1);
  std::vector<uint32_t> begin(num_keys + 1);  // by key: where the next item with it goes
  for (const Item& item : items) ++begin[key_of(item) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Item> sorted(items.size());
  for (const Item& item : items) sorted[begin[key_of(item)]++] = item;
  items.swap(sorted);
}

// By level: the number of columns of its cells.
std::array<int, kMaxLevels> NumColumns(const CameraCalibration& calibration) {
  std::array<int, kMaxLevels> num_columns{};
  for (int level = 0; level < kMaxLevels; ++level) {
    num_columns[static_cast<size_t>(level)] = CellAxis(LevelSize(calibration.width_px, level)).num_cells();
  }
  return num_columns;
}

// Those of distinct candidates in the order (level, y, x).
std::vector<Spot> SortedSpots(std::span<const Candidate> candidates) {
  std::vector<Spot> spots(candidates.size());
  for (size_t i = 0; i < candidates.size(); ++i) {
    spots[i] = {.index = static_cast<uint32_t>(i),
                .x = static_cast<uint16_t>(candidates[i].x),
                .y = static_cast<uint16_t>(candidates[i].y),
                .level = candidates[i].level};
  }
  SortByKey(spots, [](const Spot& spot) { return spot.x; });
  SortByKey(spots, [](const Spot& spot) { return spot.y; });
  SortByKey(spots, [](const Spot& spot) { return spot.level; });
  spots.erase(std::unique(spots.begin(), spots.end(), IsSamePlace), spots.end());
  return spots;
}

// Of distinct candidates in the order (level, y, x), one level after the other.
struct Entries {
  Entries(const CameraCalibration& calibration, std::span<const Candidate> candidates) {
    const std::array<int, kMaxLevels> num_columns = NumColumns(calibration);
    const std::vector<Spot> spots = SortedSpots(candidates);
    all.reserve(spots.size());
    std::array<size_t, kMaxLevels> sizes{};
    for (const Spot& spot : spots) {
      const int column = (spot.x - kBorderPx) / kCellPx, row = (spot.y - kBorderPx) / kCellPx;
      all.push_back({.index = spot.index,
                     .cell = static_cast<uint32_t>(row * num_columns[spot.level] + column),
                     .priority = candidates[spot.index].score});
      ++sizes[spot.level];
    }
    size_t first = 0;
    for (size_t level = 0; level < levels.size(); first += sizes[level], ++level) {
      levels[level] = std::span(all).subspan(first, sizes[level]);
    }
  }
  Entries(const Entries&) = delete;
  Entries& operator=(const Entries&) = delete;

  std::vector<Entry> all;
  std::array<std::span<Entry>, kMaxLevels> levels;
};

// Turns the scores of one level into priorities.
void WeighByRank(std::span<Entry> level) {
  std::vector<uint32_t> order(level.size());
  std::iota(order.begin(), order.end(), 0U);
  uint32_t best = 0;
  for (const Entry& entry : level) best = std::max(best, entry.priority);
  SortByKey(order, [&](uint32_t i) { return best - level[i].priority; });
  SortByKey(order, [&](uint32_t i) { return level[i].cell; });
  for (size_t i = 0, first_of_cell = 0; i < order.size(); ++i) {
    if (level[order[i]].cell != level[order[first_of_cell]].cell) first_of_cell = i;
    level[order[i]].priority *= RankWeight(static_cast<uint32_t>(i - first_of_cell));
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

// The better an entry of a level, the lower: by priority, then y, then x, in which order the entries stand.
uint64_t Place(std::span<const Entry> level, size_t i) { return uint64_t{UINT32_MAX - level[i].priority} << 32U | i; }
uint32_t PriorityAt(uint64_t place) { return UINT32_MAX - static_cast<uint32_t>(place >> 32U); }

// The place of the last one among the `count` best weighed entries of a level; count > 0.
uint64_t PlaceOfLast(std::span<const Entry> level, size_t count) {
  std::vector<uint64_t> places(level.size());
  for (size_t i = 0; i < level.size(); ++i) places[i] = Place(level, i);
  const auto last = places.begin() + static_cast<ptrdiff_t>(count) - 1;
  std::nth_element(places.begin(), last, places.end());
  return *last;
}

// What is known of the candidates that were found, sent or not.
struct Found {
  std::array<size_t, kMaxLevels> num{};             // of each level, at least as many as are here; all that lack ...
  std::array<uint32_t, kMaxLevels> min_priority{};  // ... have a lower priority than this
};

struct Choice {
  std::vector<uint32_t> indices;         // as ChooseCandidates has them
  std::vector<int32_t> lowest_priority;  // that was chosen, by level; 0: all that were found
  bool is_certain = true;                // it is that from all candidates
};

Choice Choose(const CameraCalibration& calibration, const FeatureOptions& options,
              std::span<const Candidate> candidates, Found found) {
  Entries entries(calibration, candidates);
  const std::array<std::span<Entry>, kMaxLevels>& levels = entries.levels;
  for (size_t l = 0; l < levels.size(); ++l) found.num[l] = std::max(found.num[l], levels[l].size());
  const std::array<size_t, kMaxLevels> taken = ShareOut(options, found.num);
  Choice choice;
  choice.indices.reserve(static_cast<size_t>(options.num_features));
  for (size_t l = 0; l < static_cast<size_t>(options.num_levels); ++l) {
    const std::span<Entry> level = levels[l];
    const size_t num = std::min(taken[l], level.size());
    uint32_t lowest = 0;
    if (num > 0 && num < found.num[l]) {
      WeighByRank(level);
      const uint64_t last = PlaceOfLast(level, num);
      lowest = PriorityAt(last);
      for (size_t i = 0; i < level.size(); ++i) {
        if (Place(level, i) <= last) choice.indices.push_back(level[i].index);
      }
    } else {
      for (const Entry& entry : level.first(num)) choice.indices.push_back(entry.index);
    }
    const bool all_are_here = level.size() == found.num[l];
    if (!all_are_here && (num < taken[l] || lowest < found.min_priority[l])) choice.is_certain = false;
    choice.lowest_priority.push_back(static_cast<int32_t>(lowest));
  }
  return choice;
}

// The answers to all jobs of a frame, each once, in the order of tiles.
struct Answers {
  std::vector<Candidate> candidates;
  std::vector<const Descriptor*> descriptors;
  Found found;
};

Answers Join(const std::vector<TileFeatures>& tiles) {
  std::map<int32_t, const TileFeatures*> ordered;
  for (const TileFeatures& tile : tiles) ordered.emplace(tile.tile, &tile);
  Answers all;
  bool is_cut = false;
  for (const auto& [number, tile] : ordered) {
    is_cut = is_cut || !tile->cuts.empty();
    all.candidates.insert(all.candidates.end(), tile->candidates.begin(), tile->candidates.end());
    for (const Descriptor& descriptor : tile->descriptors) all.descriptors.push_back(&descriptor);
    if (tile->cuts.empty()) {
      for (const Candidate& candidate : tile->candidates) ++all.found.num[candidate.level];
    }
    for (size_t level = 0; level < tile->cuts.size(); ++level) {
      uint32_t& min_priority = all.found.min_priority[level];
      all.found.num[level] += static_cast<size_t>(tile->cuts[level].num_found);
      min_priority = std::max(min_priority, static_cast<uint32_t>(tile->cuts[level].min_priority));
    }
  }
  if (!is_cut) all.found = {};
  return all;
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
  return Choose(calibration, options, candidates, {}).indices;
}

std::vector<LevelCut> LeaveOutBelow(const std::vector<int32_t>& min_priority, const CameraCalibration& calibration,
                                    std::vector<Candidate>& candidates) {
  std::vector<LevelCut> cuts;
  for (const int32_t priority : min_priority) cuts.push_back({.min_priority = priority});
  Entries entries(calibration, candidates);
  std::vector<uint32_t> kept;
  for (size_t l = 0; l < cuts.size(); ++l) {
    WeighByRank(entries.levels[l]);
    cuts[l].num_found += static_cast<int32_t>(entries.levels[l].size());
    for (const Entry& entry : entries.levels[l]) {
      if (std::cmp_greater_equal(entry.priority, cuts[l].min_priority)) kept.push_back(entry.index);
    }
  }
  std::sort(kept.begin(), kept.end());
  std::vector<Candidate> those;
  those.reserve(kept.size());
  for (const uint32_t index : kept) those.push_back(candidates[index]);
  candidates.swap(those);
  return cuts;
}

std::optional<Selection> SelectFeatures(const std::vector<TileFeatures>& tiles) {
  const TileFeatures& first = tiles.front();
  const Answers all = Join(tiles);
  Choice choice = Choose(first.calibration, first.options, all.candidates, all.found);
  if (!choice.is_certain) return std::nullopt;
  Selection selection{.features = {.frame = first.frame,
                                   .utime_us = first.utime_us,
                                   .captured_us = first.captured_us,
                                   .depth_delay_us = first.depth_delay_us,
                                   .calibration = first.calibration,
                                   .keypoints = {},
                                   .descriptors = {}},
                      .lowest_priority = std::move(choice.lowest_priority)};
  for (const uint32_t index : choice.indices) {
    selection.features.keypoints.push_back(MakeKeypoint(all.candidates[index]));
    selection.features.descriptors.push_back(*all.descriptors[index]);
  }
  return selection;
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
  const auto num_levels = static_cast<size_t>(features.options.num_levels);
  if (!features.cuts.empty() && features.cuts.size() != num_levels) {
    return Failed(name + "candidates are left out of " + std::to_string(features.cuts.size()) + " levels of " +
                  std::to_string(num_levels));
  }
  for (const LevelCut& cut : features.cuts) {
    if (cut.min_priority < 0 || cut.num_found < 0) return Failed(name + "it left out candidates below zero");
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
