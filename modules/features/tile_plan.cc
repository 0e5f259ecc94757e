#include "features/tile_plan.h"

#include <algorithm>

namespace tessera {
namespace {

// A level yields about this many candidates per selected keypoint, if all cells have enough corners.
constexpr int kCandidatesPerKeypoint = 4;
constexpr int kMinCellCapacity = 3;
constexpr int kMaxCellCapacity = 32;

Interval Grow(Interval interval, int before, int after, int size) {
  if (interval.empty()) return {};
  return {std::max(interval.begin - before, 0), std::min(interval.end + after, size)};
}

Rect MakeRect(Interval x, Interval y) {
  if (x.empty() || y.empty()) return {};
  return {.x = x.begin, .y = y.begin, .width = x.size(), .height = y.size()};
}

Interval AxisX(const Rect& rect) { return {rect.x, rect.right()}; }
Interval AxisY(const Rect& rect) { return {rect.y, rect.bottom()}; }

// The pixels of `level` that `own` and the pixels `above` of the next level need.
Rect WithSource(const Rect& own, const Rect& above) {
  return MakeRect(Hull(AxisX(own), SourceInterval(AxisX(above))), Hull(AxisY(own), SourceInterval(AxisY(above))));
}

void PlanCells(LevelPlan& plan, const Rect& core, int level) {
  const CellAxis columns(plan.width);
  const CellAxis rows(plan.height);
  plan.cell_columns = columns.CellsOf(AxisX(core), level);
  plan.cell_rows = rows.CellsOf(AxisY(core), level);
  plan.corners = MakeRect(columns.Pixels(plan.cell_columns), rows.Pixels(plan.cell_rows));
}

void PlanPixels(LevelPlan& plan, const FeatureOptions& options, int level) {
  const Interval x = AxisX(plan.corners);
  const Interval y = AxisY(plan.corners);
  plan.left = MakeRect(Grow(x, kBorderPx, kBorderPx, plan.width), Grow(y, kBorderPx, kBorderPx, plan.height));
  plan.right = MakeRect(Grow(x, kStereoMarginPx + LevelDisparity(options, level), kStereoMarginPx, plan.width),
                        Grow(y, kStereoRadiusPx, kStereoRadiusPx, plan.height));
}

// Level-0 pixels at which the pixels of the interval stand.
Interval LevelZeroPixels(Interval interval, int level) {
  if (interval.empty()) return {};
  return {LevelZeroEdge(2 * interval.begin + 1, level), LevelZeroEdge(2 * interval.end - 1, level) + 1};
}

}  // namespace

Interval CellAxis::Pixels(Interval cells) const {
  if (cells.empty()) return {};
  return {kBorderPx + cells.begin * kCellPx, std::min(kBorderPx + cells.end * kCellPx, level_size - kBorderPx)};
}

Interval CellAxis::CellsOf(Interval core, int level) const {
  const auto centre_of = [this, level](int cell) {
    const Interval pixels = Pixels({cell, cell + 1});
    return LevelZeroEdge(pixels.begin + pixels.end, level);
  };
  Interval cells;
  while (cells.begin < num_cells() && centre_of(cells.begin) < core.begin) ++cells.begin;
  cells.end = cells.begin;
  while (cells.end < num_cells() && centre_of(cells.end) < core.end) ++cells.end;
  return cells;
}

int LevelDisparity(const FeatureOptions& options, int level) {
  return static_cast<int>(options.max_disparity_px / LevelScale(level));
}

bool TilePlan::HasCells() const {
  return std::any_of(levels.begin(), levels.end(), [](const LevelPlan& level) { return !level.corners.empty(); });
}

TilePlan PlanTile(const CameraCalibration& calibration, const FeatureOptions& options, const Rect& core,
                  int first_level, int last_level) {
  TilePlan plan;
  Interval depth_x;
  Interval depth_y;
  Rect left_above;
  Rect right_above;
  for (int level = last_level; level >= first_level; --level) {
    LevelPlan& level_plan = plan.levels[static_cast<size_t>(level)];
    level_plan.width = LevelSize(calibration.width_px, level);
    level_plan.height = LevelSize(calibration.height_px, level);
    PlanCells(level_plan, core, level);
    if (!level_plan.corners.empty()) PlanPixels(level_plan, options, level);
    level_plan.left = left_above = WithSource(level_plan.left, left_above);
    level_plan.right = right_above = WithSource(level_plan.right, right_above);
    depth_x = Hull(depth_x, LevelZeroPixels(AxisX(level_plan.corners), level));
    depth_y = Hull(depth_y, LevelZeroPixels(AxisY(level_plan.corners), level));
  }
  plan.depth = MakeRect(depth_x, depth_y);
  return plan;
}

std::array<int, kMaxLevels> LevelQuotas(const FeatureOptions& options) {
  // 5^l 6^(L-1-l) / sum over all levels: whole numbers in the ratio of (5/6)^l.
  std::array<int64_t, kMaxLevels> weights{};
  int64_t sum = 0;
  for (int level = 0; level < options.num_levels; ++level) {
    int64_t weight = 1;
    for (int l = 0; l < options.num_levels - 1; ++l) weight *= l < level ? 5 : 6;
    weights[static_cast<size_t>(level)] = weight;
    sum += weight;
  }
  std::array<int, kMaxLevels> quotas{};
  int rest = options.num_features;
  for (size_t level = 0; level < static_cast<size_t>(options.num_levels); ++level) {
    quotas[level] = static_cast<int>(options.num_features * weights[level] / sum);
    rest -= quotas[level];
  }
  quotas[0] += rest;
  return quotas;
}

int CellCapacity(const FeatureOptions& options, int level, int level_width, int level_height) {
  const int num_cells = CellAxis(level_width).num_cells() * CellAxis(level_height).num_cells();
  if (num_cells == 0) return 0;
  const int wanted = kCandidatesPerKeypoint * LevelQuotas(options)[static_cast<size_t>(level)];
  return std::clamp((wanted + num_cells - 1) / num_cells, kMinCellCapacity, kMaxCellCapacity);
}

}  // namespace tessera
