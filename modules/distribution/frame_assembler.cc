#include "distribution/frame_assembler.h"

#include <vector>

namespace tessera {

FrameAssembler::Result FrameAssembler::Add(TileFeatures tile) {
  if (tile.frame <= last_released_) {
    return Result::kRepeated;
  }
  const std::pair key{tile.frame, tile.tile};
  if (blocks_.contains(key)) {
    return Result::kRepeated;
  }
  if (!tile.cuts.empty() && wanted_whole_.contains(tile.frame)) {
    return Result::kTooFew;
  }
  const auto sibling = blocks_.lower_bound({tile.frame, 0});
  if (sibling != blocks_.end() && sibling->first.first == tile.frame) {
    const TileFeatures& other = sibling->second;
    // A dispatcher that was started again need not drop the frames that the one before dropped: either's word on the
    // previous frame will do.
    if (other.num_tiles != tile.num_tiles || other.options != tile.options || other.calibration != tile.calibration) {
      return Result::kRefused;
    }
  } else if (num_open_frames() >= max_open_frames_) {
    return Result::kRefused;
  }
  ++num_blocks_[tile.frame];
  blocks_.emplace(key, std::move(tile));
  return Result::kKept;
}

void FrameAssembler::SkipTo(FrameId frame) {
  if (frame <= last_released_) return;
  last_released_ = frame;
  blocks_.erase(blocks_.begin(), blocks_.lower_bound({FrameId{frame.value + 1}, 0}));
  num_blocks_.erase(num_blocks_.begin(), num_blocks_.upper_bound(frame));
  wanted_whole_.erase(wanted_whole_.begin(), wanted_whole_.upper_bound(frame));
}

bool FrameAssembler::CanRelease() const {
  if (num_blocks_.empty()) {
    return false;
  }
  const auto& [frame, num_blocks] = *num_blocks_.begin();
  const TileFeatures& first = blocks_.lower_bound({frame, 0})->second;
  return num_blocks == first.num_tiles && first.previous_frame <= last_released_;
}

std::optional<Selection> FrameAssembler::ReleaseNext() {
  const FrameId frame = num_blocks_.begin()->first;
  const auto begin = blocks_.lower_bound({frame, 0});
  const auto end = blocks_.lower_bound({FrameId{frame.value + 1}, 0});
  std::vector<TileFeatures> tiles;
  for (auto block = begin; block != end; ++block) tiles.push_back(std::move(block->second));
  blocks_.erase(begin, end);
  num_blocks_.erase(frame);
  std::optional<Selection> selection = SelectFeatures(tiles);
  if (!selection) {
    AwaitAll(frame, std::move(tiles));
    return std::nullopt;
  }
  if (tiles.size() == 1) selection->lowest_priority.clear();  // a whole image: nothing is left out of the next one
  wanted_whole_.erase(frame);
  last_released_ = frame;
  return selection;
}

void FrameAssembler::AwaitAll(FrameId frame, std::vector<TileFeatures> tiles) {
  wanted_whole_.insert(frame);
  TileAck forgotten{.frame = frame, .tiles = {}, .wants_all = true, .lowest_priority = {}};
  for (TileFeatures& tile : tiles) {
    const int32_t number = tile.tile;
    if (Add(std::move(tile)) == Result::kTooFew) forgotten.tiles.push_back(number);
  }
  forgotten_.push_back(std::move(forgotten));
}

int FrameAssembler::num_open_frames() const { return static_cast<int>(num_blocks_.size()); }

}  // namespace tessera
