// TILE_<n>, TILE_FEATURES, TILE_ACK, EXTRACTOR_READY.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "features/feature_types.h"
#include "messages/stage_messages.h"
#include "messages/topics.h"
#include "tessera/extractor_ready_t.hpp"
#include "tessera/tile_ack_t.hpp"
#include "tessera/tile_features_t.hpp"
#include "tessera/tile_job_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr int32_t kMaxTiles = 1 << 16;
constexpr int32_t kMaxCandidates = 1 << 20;

// What jobs and their answers have in common.
template <class Message, class Value>
void SetTile(const Value& value, Message* message) {
  message->run = value.run;
  message->frame = value.frame.value;
  message->previous_frame = value.previous_frame.value;
  message->utime = value.utime_us;
  message->arrival = value.arrival_us;
  message->tile = value.tile;
  message->num_tiles = value.num_tiles;
  message->camera = ToMessage(value.calibration);
  message->options = ToMessage(value.options);
}

template <class Message, class Value>
std::string GetTile(const Message& message, Value* value) {
  value->run = message.run;
  value->frame.value = message.frame;
  value->previous_frame.value = message.previous_frame;
  value->utime_us = message.utime;
  value->arrival_us = message.arrival;
  value->tile = message.tile;
  value->num_tiles = message.num_tiles;
  return FirstProblem(
      {CheckFrame(message.frame), CheckTimes(message.utime, message.arrival), CheckTimes(message.run, 0),
       SentenceUnless(message.previous_frame >= -1 && message.previous_frame < message.frame,
                      "the frame before it does not have a lower number"),
       SentenceUnless(message.num_tiles >= 1 && message.num_tiles <= kMaxTiles && message.tile >= 0 &&
                          message.tile < message.num_tiles,
                      "its tile number is out of range"),
       FromMessage(message.camera, &value->calibration), FromMessage(message.options, &value->options)});
}

template <class Message, class Value>
bool IsSameTile(const Message& message, const Value& value) {
  return message.run == value.run && message.frame == value.frame.value && message.tile == value.tile &&
         message.num_tiles == value.num_tiles;
}

}  // namespace

template <>
struct Codec<TileJob> {
  using Message = tile_job_t;
  static constexpr const char* kTypeName = "tile_job_t";

  template <class Emit>
  static void Cut(const TileJob& job, Message* message, size_t max_bytes, Emit emit) {
    SetTile(job, message);
    message->first_level = job.first_level;
    message->last_level = job.last_level;
    message->core = ToMessage(job.core);
    message->left_rect = ToMessage(job.left_rect);
    message->right_rect = ToMessage(job.right_rect);
    message->depth_rect = ToMessage(job.depth_rect);
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    CutBands({Banded(image_band_t::LEFT, job.left), Banded(image_band_t::RIGHT, job.right),
              Banded(image_band_t::DEPTH, job.depth)},
             max_bytes - overhead, &message->band, [&] { emit(*message); });
  }

  static std::string Join(const Message& message, TileJob* job) {
    if (message.header.part == 0) {
      if (const std::string problem = Begin(message, job); !problem.empty()) return problem;
    }
    if (!IsSameTile(message, *job)) {
      return "its parts belong to different jobs";
    }
    if (std::string problem = AddBand(message.band, job); !problem.empty()) return problem;
    const bool is_last = message.header.part + 1 == message.header.num_parts;
    return SentenceUnless(!is_last || Misses(*job) < 0, "not all of its pixels came");
  }

 private:
  static std::string Begin(const Message& message, TileJob* job) {
    *job = {};
    if (std::string problem = GetTile(message, job); !problem.empty()) return problem;
    job->first_level = message.first_level;
    job->last_level = message.last_level;
    const int width = job->calibration.width_px;
    const int height = job->calibration.height_px;
    return FirstProblem({SentenceUnless(job->first_level >= 0 && job->first_level <= job->last_level &&
                                            job->last_level < job->options.num_levels,
                                        "its range of pyramid levels is out of range"),
                         FromMessage(message.core, width, height, false, &job->core),
                         FromMessage(message.left_rect, width, height, false, &job->left_rect),
                         FromMessage(message.right_rect, width, height, true, &job->right_rect),
                         FromMessage(message.depth_rect, width, height, true, &job->depth_rect)});
  }
  // The image that the next pixels belong to; -1 if the job is complete.
  static int Misses(const TileJob& job) {
    if (!IsComplete(job.left, job.left_rect.width, job.left_rect.height)) return image_band_t::LEFT;
    if (!IsComplete(job.right, job.right_rect.width, job.right_rect.height)) return image_band_t::RIGHT;
    if (!IsComplete(job.depth, job.depth_rect.width, job.depth_rect.height)) return image_band_t::DEPTH;
    return -1;
  }
  static std::string AddBand(const image_band_t& band, TileJob* job) {
    if (band.image != Misses(*job)) {
      return "its parts are not in order";
    }
    switch (band.image) {
      case image_band_t::LEFT:
        return JoinBand(band, job->left_rect.width, job->left_rect.height, &job->left);
      case image_band_t::RIGHT:
        return JoinBand(band, job->right_rect.width, job->right_rect.height, &job->right);
      default:
        return JoinBand(band, job->depth_rect.width, job->depth_rect.height, &job->depth);
    }
  }
};
TESSERA_CODEC(TileJob);

template <>
struct Codec<TileFeatures> {
  using Message = tile_features_t;
  static constexpr const char* kTypeName = "tile_features_t";
  static constexpr size_t kBytesPerCandidate = 2 + 2 + 1 + 1 + 1 + 1 + 4 + 4 + 4 + 32;

  template <class Emit>
  static void Cut(const TileFeatures& features, Message* message, size_t max_bytes, Emit emit) {
    SetTile(features, message);
    const size_t num_total = features.candidates.size();
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    const size_t per_part = std::max<size_t>(1, (max_bytes - overhead) / kBytesPerCandidate);
    message->num_total = static_cast<int32_t>(num_total);
    size_t first = 0;
    do {
      const size_t num = std::min(per_part, num_total - first);
      Fill(features, first, num, message);
      emit(*message);
      first += num;
    } while (first < num_total);
  }

  static std::string Join(const Message& message, TileFeatures* features) {
    if (message.header.part == 0) {
      *features = {};
      if (std::string problem = GetTile(message, features); !problem.empty()) return problem;
    }
    const size_t num_had = features->candidates.size();
    const bool is_last = message.header.part + 1 == message.header.num_parts;
    const auto num_now = static_cast<int64_t>(num_had) + message.num_candidates;
    if (!IsSameTile(message, *features) || message.first != static_cast<int64_t>(num_had) ||
        message.num_total > kMaxCandidates || num_now > message.num_total ||
        (is_last && num_now != message.num_total)) {
      return "its parts do not fit together";
    }
    features->candidates.reserve(num_had + static_cast<size_t>(message.num_candidates));
    for (size_t i = 0; i < static_cast<size_t>(message.num_candidates); ++i) {
      if (!IsInRange(message, i, *features)) {
        return "a candidate is out of range";
      }
      features->candidates.push_back({.x = message.x[i],
                                      .y = message.y[i],
                                      .offset_x = message.offset_x[i],
                                      .offset_y = message.offset_y[i],
                                      .level = message.level[i],
                                      .angle = message.angle[i],
                                      .score = static_cast<uint16_t>(message.score[i]),
                                      .right_x_px = message.right_x[i],
                                      .depth_m = message.depth_m[i]});
      features->descriptors.push_back(FromMessage(message.descriptors[i]));
    }
    return "";
  }

 private:
  static void Fill(const TileFeatures& features, size_t first, size_t num, Message* message) {
    message->first = static_cast<int32_t>(first);
    message->num_candidates = static_cast<int32_t>(num);
    message->x.resize(num);
    message->y.resize(num);
    message->offset_x.resize(num);
    message->offset_y.resize(num);
    message->level.resize(num);
    message->angle.resize(num);
    message->score.resize(num);
    message->right_x.resize(num);
    message->depth_m.resize(num);
    message->descriptors.resize(num);
    for (size_t i = 0; i < num; ++i) {
      const Candidate& candidate = features.candidates[first + i];
      message->x[i] = candidate.x;
      message->y[i] = candidate.y;
      message->offset_x[i] = candidate.offset_x;
      message->offset_y[i] = candidate.offset_y;
      message->level[i] = candidate.level;
      message->angle[i] = candidate.angle;
      message->score[i] = candidate.score;
      message->right_x[i] = candidate.right_x_px;
      message->depth_m[i] = candidate.depth_m;
      message->descriptors[i] = ToMessage(features.descriptors[first + i]);
    }
  }
  static bool IsInRange(const Message& message, size_t i, const TileFeatures& features) {
    const auto is_within_pixel = [](int offset) { return 2 * std::abs(offset) <= kCornerSubpixels; };
    return is_within_pixel(message.offset_x[i]) && is_within_pixel(message.offset_y[i]) && message.x[i] >= 0 &&
           message.x[i] < features.calibration.width_px && message.y[i] >= 0 &&
           message.y[i] < features.calibration.height_px && message.level[i] < features.options.num_levels &&
           message.score[i] >= 0 && message.score[i] <= UINT16_MAX && std::isfinite(message.right_x[i]) &&
           std::isfinite(message.depth_m[i]) && message.depth_m[i] >= 0.0F;
  }
};
TESSERA_CODEC(TileFeatures);

template <>
struct Codec<TileAck> {
  using Message = tile_ack_t;
  static constexpr const char* kTypeName = "tile_ack_t";

  template <class Emit>
  static void Cut(const TileAck& ack, Message* message, size_t, Emit emit) {
    message->frame = ack.frame.value;
    message->tiles = ack.tiles;
    message->num_tiles = static_cast<int32_t>(ack.tiles.size());
    emit(*message);
  }
  static std::string Join(const Message& message, TileAck* ack) {
    ack->frame.value = message.frame;
    ack->tiles.assign(message.tiles.begin(), message.tiles.begin() + message.num_tiles);
    const bool in_range =
        std::all_of(ack->tiles.begin(), ack->tiles.end(), [](int32_t tile) { return tile >= 0 && tile < kMaxTiles; });
    return FirstProblem({CheckFrame(message.frame), SentenceUnless(in_range, "a tile number is out of range")});
  }
};
TESSERA_CODEC(TileAck);

template <>
struct Codec<ExtractorReady> {
  using Message = extractor_ready_t;
  static constexpr const char* kTypeName = "extractor_ready_t";

  template <class Emit>
  static void Cut(const ExtractorReady& ready, Message* message, size_t, Emit emit) {
    message->extractor = ready.extractor;
    message->extractor_epoch_us = ready.epoch_us;
    message->num_jobs_done = ready.num_jobs_done;
    message->num_robots = ready.num_robots;
    emit(*message);
  }
  static std::string Join(const Message& message, ExtractorReady* ready) {
    *ready = {.extractor = message.extractor,
              .epoch_us = message.extractor_epoch_us,
              .num_jobs_done = message.num_jobs_done,
              .num_robots = message.num_robots};
    return FirstProblem(
        {CheckTimes(ready->epoch_us, 0),
         SentenceUnless(ready->extractor >= 0 && ready->extractor < kMaxExtractors && ready->num_jobs_done >= 0 &&
                            ready->num_robots >= 1 && ready->num_robots <= kMaxRobots,
                        "its extractor's id or a count is out of range")});
  }
};
TESSERA_CODEC(ExtractorReady);

}  // namespace tessera
