#include "distribution/frame_assembler.h"

#include <vector>

#include "features/selection.h"

namespace tessera {

FrameAssembler::Result FrameAssembler::Add(TileFeatures tile) {
  if (tile.frame <= last_released_) {
    return Result::kRepeated;
  }
  const std::pair key{tile.frame, tile.tile};
  if (blocks_.contains(key)) {
    return Result::kRepeated;
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
}

bool FrameAssembler::CanRelease() const {
  if (num_blocks_.empty()) {
    return false;
  }
  const auto& [frame, num_blocks] = *num_blocks_.begin();
  const TileFeatures& first = blocks_.lower_bound({frame, 0})->second;
  return num_blocks == first.num_tiles && first.previous_frame <= last_released_;
}

FeatureFrame FrameAssembler::ReleaseNext() {
  const FrameId frame = num_blocks_.begin()->first;
  const auto begin = blocks_.lower_bound({frame, 0});
  auto end = begin;
  std::vector<TileFeatures> tiles;
  for (; end != blocks_.end() && end->first.first == frame; ++end) {
    tiles.push_back(std::move(end->second));
  }
  blocks_.erase(begin, end);
  num_blocks_.erase(frame);
  last_released_ = frame;
  return SelectFeatures(tiles);
}

int FrameAssembler::num_open_frames() const { return static_cast<int>(num_blocks_.size()); }

}  // namespace tessera
