#include "features/tiling.h"

#include <algorithm>
#include <charconv>
#include <functional>
#include <utility>

#include "core/errors.h"
#include "features/exposure.h"
#include "features/pyramid.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

bool Contains(const Rect& outer, const Rect& inner) {
  return inner.empty() || (inner.x >= outer.x && inner.y >= outer.y && inner.right() <= outer.right() &&
                           inner.bottom() <= outer.bottom());
}

// The rectangle has sane numbers and lies within a level of the images; it may be empty.
bool LiesWithin(const Rect& rect, const CameraCalibration& calibration, int level) {
  const auto is_part = [](int begin, int size, int whole) {
    return begin >= 0 && size >= 0 && begin <= whole && size <= whole - begin;
  };
  return is_part(rect.x, rect.width, LevelSize(calibration.width_px, level)) &&
         is_part(rect.y, rect.height, LevelSize(calibration.height_px, level));
}

template <class Pixel>
bool HasSize(const Image<Pixel>& image, int width, int height) {
  return image.width == width && image.height == height &&
         image.pixels.size() == static_cast<size_t>(width) * static_cast<size_t>(height);
}

// The pixels of one image of a job, which are of this level.
template <class Pixel>
Result<> CheckPixels(const std::string& name, const CameraCalibration& calibration, int level, const Rect& rect,
                     const Image<Pixel>& image, const Rect& needed) {
  if (!LiesWithin(rect, calibration, level)) return Failed("the " + name + " rectangle leaves the image");
  if (!HasSize(image, rect.width, rect.height)) {
    return Failed("the " + name + " pixels are not as many as the rectangle's");
  }
  if (!Contains(rect, needed)) return Failed("the " + name + " pixels lack the margin that the tile needs");
  return {};
}

Result<> CheckNumbers(const TileJob& job) {
  if (!job.frame.valid()) return Failed("the frame number is negative");
  if (job.num_tiles < 1 || job.tile < 0 || job.tile >= job.num_tiles) {
    return Failed("there are " + std::to_string(job.num_tiles) + " tiles");
  }
  TESSERA_RETURN_IF_FAILED(job.calibration.Check());
  TESSERA_RETURN_IF_FAILED(job.options.Check());
  if (job.first_level < 0 || job.last_level < job.first_level || job.last_level >= job.options.num_levels) {
    return Failed("levels " + std::to_string(job.first_level) + " to " + std::to_string(job.last_level) +
                  " are not a range of the pyramid's " + std::to_string(job.options.num_levels));
  }
  if (!job.min_priority.empty() && job.min_priority.size() != static_cast<size_t>(job.options.num_levels)) {
    return Failed("it names the lowest priorities of " + std::to_string(job.min_priority.size()) +
                  " levels, which is not the pyramid's number");
  }
  if (!LiesWithin(job.core, job.calibration, 0)) return Failed("the core leaves the image");
  return {};
}

Result<> CheckImages(const TileJob& job) {
  const TilePlan plan = PlanTile(job.calibration, job.options, job.core, job.first_level, job.last_level);
  const int level = job.first_level;
  const LevelPlan& needed = plan.levels[static_cast<size_t>(level)];
  TESSERA_RETURN_IF_FAILED(CheckPixels("left", job.calibration, level, job.left_rect, job.left, needed.left));
  if (job.calibration.sensor == SensorType::kStereo) {
    return CheckPixels("right", job.calibration, level, job.right_rect, job.right, needed.right);
  }
  if (job.calibration.sensor == SensorType::kRgbd) {
    return CheckPixels("depth", job.calibration, 0, job.depth_rect, job.depth, plan.depth);
  }
  return {};
}

// Part of the image; the image itself if that is all of it and nobody else needs it.
template <class Pixel>
Image<Pixel> Take(Image<Pixel>& image, const Rect& rect, bool is_only_job) {
  const bool is_whole = rect == Rect{.x = 0, .y = 0, .width = image.width, .height = image.height};
  return is_only_job && is_whole ? std::move(image) : Crop(image, rect);
}
// Likewise of a level of the image.
GrayImage TakeLevel(GrayImage& image, int level, const Rect& rect, bool is_only_job) {
  return level == 0 ? Take(image, rect, is_only_job) : Crop(ReduceToLevel(image, level), rect);
}

// Rectangles and pixels of the job, for the core and the levels that it has.
void TakePixels(CameraFrame& frame, TileJob& job, const TilePlan& plan, bool is_only_job) {
  const LevelPlan& needed = plan.levels[static_cast<size_t>(job.first_level)];
  job.left_rect = needed.left;
  job.left = TakeLevel(frame.left, job.first_level, job.left_rect, is_only_job);
  if (job.calibration.sensor == SensorType::kStereo) {
    job.right_rect = needed.right;
    job.right = TakeLevel(frame.right, job.first_level, job.right_rect, is_only_job);
  }
  if (job.calibration.sensor == SensorType::kRgbd) {
    job.depth_rect = plan.depth;
    job.depth = Take(frame.depth, job.depth_rect, is_only_job);
  }
}

void CheckFrame(const CameraFrame& frame, const CameraCalibration& calibration, const FeatureOptions& options) {
  const std::string where = "frame " + std::to_string(frame.id.value) + ": ";
  ThrowIfFailed<InputError>(calibration.Check(), where);
  ThrowIfFailed<InputError>(options.Check(), where);
  const auto fits = [&calibration](const auto& image) {
    return HasSize(image, calibration.width_px, calibration.height_px);
  };
  const SensorType sensor = calibration.sensor;
  if (!fits(frame.left) || (sensor == SensorType::kStereo && !fits(frame.right)) ||
      (sensor == SensorType::kRgbd && !fits(frame.depth))) {
    throw InputError(where + "its images are not all " + std::to_string(calibration.width_px) + "x" +
                     std::to_string(calibration.height_px) + " px as the calibration says");
  }
}

}  // namespace

TileGrid ParseTileGrid(const std::string& text) {
  TileGrid grid;
  const char* const end = text.data() + text.size();
  const auto [separator, lines_error] = std::from_chars(text.data(), end, grid.lines);
  bool is_good = lines_error == std::errc() && separator != end && *separator == 'x';
  if (is_good) {
    const auto [rest, columns_error] = std::from_chars(separator + 1, end, grid.columns);
    is_good = columns_error == std::errc() && rest == end;
  }
  const auto in_range = [](int side) { return side >= 1 && side <= TileGrid::kMaxSide; };
  if (!is_good || !in_range(grid.lines) || !in_range(grid.columns)) {
    throw InputError("tiles \"" + text + "\" must be LINESxCOLUMNS with whole numbers from 1 to " +
                     std::to_string(TileGrid::kMaxSide) + ", such as 2x3");
  }
  return grid;
}

std::vector<TileJob> CutFrame(CameraFrame frame, const CameraCalibration& calibration, int64_t captured_us,
                              TileGrid grid, int coarse_levels_from, const FeatureOptions& options) {
  CheckFrame(frame, calibration, options);
  if (calibration.sensor == SensorType::kStereo) MatchExposure(frame.left, frame.right);
  const bool is_cut = grid.lines * grid.columns > 1;
  std::vector<TileJob> jobs;
  const auto add = [&](const Rect& core, int first_level, int last_level, bool even_if_idle) {
    if (first_level > last_level) return;
    const TilePlan plan = PlanTile(calibration, options, core, first_level, last_level);
    if (!plan.HasCells() && !even_if_idle) return;
    TileJob& job = jobs.emplace_back();
    job.frame = frame.id;
    job.utime_us = frame.utime_us;
    job.captured_us = captured_us;
    job.depth_delay_us = frame.depth_delay_us;
    job.calibration = calibration;
    job.options = options;
    job.first_level = first_level;
    job.last_level = last_level;
    job.core = core;
    TakePixels(frame, job, plan, !is_cut);
  };

  const Rect whole{.x = 0, .y = 0, .width = calibration.width_px, .height = calibration.height_px};
  const int first_coarse_level = is_cut ? std::clamp(coarse_levels_from, 0, options.num_levels) : 0;
  add(whole, first_coarse_level, options.num_levels - 1, false);
  for (int line = 0; is_cut && line < grid.lines; ++line) {
    for (int column = 0; column < grid.columns; ++column) {
      const int x = whole.width * column / grid.columns;
      const int y = whole.height * line / grid.lines;
      const Rect core{.x = x,
                      .y = y,
                      .width = whole.width * (column + 1) / grid.columns - x,
                      .height = whole.height * (line + 1) / grid.lines - y};
      add(core, 0, first_coarse_level - 1, false);
    }
  }
  if (jobs.empty()) add(whole, 0, options.num_levels - 1, true);  // every frame has an answer
  std::ranges::stable_sort(jobs, std::greater(), WorkOf);
  for (size_t tile = 0; tile < jobs.size(); ++tile) {
    jobs[tile].tile = static_cast<int32_t>(tile);
    jobs[tile].num_tiles = static_cast<int32_t>(jobs.size());
  }
  return jobs;
}

int64_t WorkOf(const TileJob& job) {
  auto num_pixels = static_cast<int64_t>(job.left.pixels.size() + job.right.pixels.size() + job.depth.pixels.size());
  int64_t work = 0;
  for (int32_t level = job.first_level; level <= job.last_level; ++level) {
    work += num_pixels;
    num_pixels = num_pixels * 25 / 36;  // each level is 5/6 of the one below in both directions
  }
  return std::max<int64_t>(work, 1);
}

Result<> CheckTileJob(const TileJob& job) {
  Result<> checked = CheckNumbers(job);
  if (checked) checked = CheckImages(job);
  if (checked) return {};
  return Failed("tile " + std::to_string(job.tile) + " of frame " + std::to_string(job.frame.value) + ": " +
                checked.error().sentence);
}

}  // namespace tessera
