// TILE_<n>, TILE_FEATURES, TILE_ACK, EXTRACTOR_READY.
#include <algorithm>
#include <cstdlib>

#include "features/feature_types.h"
#include "messages/stage_messages.h"
#include "messages/topics.h"
#include "tessera/extractor_ready_t.hpp"
#include "tessera/tile_ack_t.hpp"
#include "tessera/tile_features_t.hpp"
#include "tessera/tile_job_t.hpp"
#include "tessera/tile_origin_t.hpp"
#include "tessera/tile_plan_t.hpp"
#include "wire/codec_impl.h"

namespace tessera {
namespace {

constexpr int32_t kMaxTiles = 1 << 16;
constexpr int32_t kMaxPackedBytes = 1 << 28;

// What all parts of jobs and of their answers have in common.
template <class Fields, class Message, class Value>
void DescribeTile(Fields& fields, Message& message, Value& tile) {
  fields.Key(message.run, tile.run);
  fields.Key(message.frame, tile.frame);
  fields.Key(message.tile, tile.tile);
  fields.Key(message.num_tiles, tile.num_tiles);
  fields.Check(tile.frame.valid(), "its frame number is negative");
  fields.Check(tile.num_tiles <= kMaxTiles && tile.tile >= 0 && tile.tile < tile.num_tiles,
               "its tile number is out of range");
}

// What the first part of either brings.
template <class Fields, class Message, class Value>
void DescribeOrigin(Fields& fields, Message& message, Value& tile) {
  fields(message.previous_frame, tile.previous_frame);
  fields.Time(message.utime, tile.utime_us);
  fields.Time(message.captured, tile.captured_us);
  fields.Time(message.depth_delay, tile.depth_delay_us);
  fields(message.camera, tile.calibration);
  fields(message.options, tile.options);
  fields.Check(tile.previous_frame < tile.frame, "its frame number is not above that of the frame before it");
}

bool IsInRange(const Candidate& candidate, const CameraCalibration& camera, const FeatureOptions& options) {
  const auto is_within_pixel = [](int offset) { return 2 * std::abs(offset) <= kCornerSubpixels; };
  return is_within_pixel(candidate.offset_x) && is_within_pixel(candidate.offset_y) && candidate.x >= 0 &&
         candidate.x < camera.width_px && candidate.y >= 0 && candidate.y < camera.height_px &&
         candidate.level < options.num_levels && candidate.depth_m >= 0.0F;
}

}  // namespace

template <>
struct Layout<tile_plan_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& job) {
    DescribeOrigin(fields, message, job);
    fields(message.first_level, job.first_level);
    fields(message.last_level, job.last_level);
    fields(message.core, job.core);
    fields(message.left_rect, job.left_rect);
    fields(message.right_rect, job.right_rect);
    fields(message.depth_rect, job.depth_rect);
    fields.Check(job.first_level >= 0 && job.first_level <= job.last_level && job.last_level < job.options.num_levels,
                 "its range of pyramid levels is out of range");
    const auto is_inside = [&](const Rect& rect) {
      return IsInside(rect, job.calibration.width_px, job.calibration.height_px);
    };
    const auto is_inside_or_empty = [&](const Rect& rect) { return rect == Rect{} || is_inside(rect); };
    fields.Check(is_inside(job.core) && is_inside(job.left_rect) && is_inside_or_empty(job.right_rect) &&
                     is_inside_or_empty(job.depth_rect),
                 "a rectangle leaves the image");
    fields.List(message.num_levels, message.min_priority, job.min_priority);
    fields.Check(job.min_priority.size() <= kMaxLevels, "it names more levels than a pyramid has");
    fields(message.num_packed, job.packed.width);
    fields.Check(job.packed.width >= 0 && job.packed.width <= kMaxPackedBytes, "its packed images are too large");
  }
};

template <>
struct Layout<tile_job_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& job) {
    DescribeTile(fields, message, job);
    fields.Once(message.num_plans, message.plan, job);
    const bool is_packed = job.packed.width > 0;
    const auto image = [is_packed](int8_t name, auto& pixels, const Rect& rect) {
      return ImageField{name, pixels, is_packed ? 0 : rect.width, is_packed ? 0 : rect.height};
    };
    fields.Bands(message.band, ImageField{image_band_t::PACKED, job.packed, job.packed.width, is_packed ? 1 : 0},
                 image(image_band_t::LEFT, job.left, job.left_rect),
                 image(image_band_t::RIGHT, job.right, job.right_rect),
                 image(image_band_t::DEPTH, job.depth, job.depth_rect));
  }
};
TESSERA_CODEC(TileJob, tile_job_t);

template <>
struct Layout<tile_origin_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& tile) {
    DescribeOrigin(fields, message, tile);
    fields.Table(
        message.num_levels, [&](size_t i) { return i < kMaxLevels && tile.cuts[i].num_found >= 0; },
        Column(message.min_priority, tile.cuts, &LevelCut::min_priority),
        Column(message.num_found, tile.cuts, &LevelCut::num_found));
  }
};

template <>
struct Layout<tile_features_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& tile) {
    DescribeTile(fields, message, tile);
    fields.Once(message.num_origins, message.origin, tile);
    auto& candidates = tile.candidates;
    fields.WholeTable(
        message.num_total, message.first, message.num_candidates,
        [&](size_t i) { return IsInRange(candidates[i], tile.calibration, tile.options); },
        Column(message.x, candidates, &Candidate::x), Column(message.y, candidates, &Candidate::y),
        Column(message.offset_x, candidates, &Candidate::offset_x),
        Column(message.offset_y, candidates, &Candidate::offset_y),
        Column(message.level, candidates, &Candidate::level), Column(message.angle, candidates, &Candidate::angle),
        Column(message.score, candidates, &Candidate::score),
        Column(message.right_x, candidates, &Candidate::right_x_px),
        Column(message.depth_m, candidates, &Candidate::depth_m), Column(message.descriptors, tile.descriptors));
  }
};
TESSERA_CODEC(TileFeatures, tile_features_t);

template <>
struct Layout<tile_ack_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& ack) {
    fields.Key(message.frame, ack.frame);
    fields.Check(ack.frame.valid(), "its frame number is negative");
    fields.Table(
        message.num_tiles, [&](size_t i) { return ack.tiles[i] >= 0 && ack.tiles[i] < kMaxTiles; },
        Column(message.tiles, ack.tiles));
    fields(message.wants_all, ack.wants_all);
    fields.List(message.num_levels, message.lowest_priority, ack.lowest_priority);
    fields.Check(ack.lowest_priority.size() <= kMaxLevels, "it names more levels than a pyramid has");
  }
};
TESSERA_CODEC(TileAck, tile_ack_t);

template <>
struct Layout<extractor_ready_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& ready) {
    fields.Count(message.extractor, ready.extractor);
    fields.Time(message.extractor_epoch_us, ready.epoch_us);
    fields.Count(message.num_jobs_done, ready.num_jobs_done);
    fields.Count(message.num_robots, ready.num_robots);
    fields.Check(ready.extractor < kMaxExtractors, "its extractor's id is out of range");
    fields.Check(ready.num_robots >= 1 && ready.num_robots <= kMaxRobots, "its number of robots is out of range");
  }
};
TESSERA_CODEC(ExtractorReady, extractor_ready_t);

}  // namespace tessera
