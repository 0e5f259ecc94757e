// Puts the candidates of each frame together again and releases frames in their order.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "features/feature_types.h"
#include "features/selection.h"
#include "messages/stage_messages.h"

namespace tessera {

class FrameAssembler {
 public:
  // At most `max_open_frames` frames are kept waiting for tiles.
  explicit FrameAssembler(int max_open_frames) : max_open_frames_(max_open_frames) {}

  enum class Result {
    kKept,      // new
    kRepeated,  // was there already, or its frame is released: nothing to do
    kTooFew,    // candidates were left out, and those of its frame that are wanted may be among them
    kRefused,   // contradicts the tiles of its frame that are there, or too many frames are open
  };
  Result Add(TileFeatures tile);
  // This frame, and all before it, need not be released: they were by an assembler before this one.
  void SkipTo(FrameId frame);

  // Whether all tiles of the next frame in order are there.
  bool CanRelease() const;
  // The features of that frame, with the lowest priorities if it was cut; needs CanRelease(). nullopt: what was left
  // out of some tiles may be needed. They are forgotten, and awaited with all candidates.
  std::optional<Selection> ReleaseNext();
  // What the last calls of ReleaseNext forgot, a frame each.
  std::vector<TileAck> TakeForgotten() { return std::exchange(forgotten_, {}); }

  int num_open_frames() const;
  // The last frame released, here or before; invalid if none was.
  FrameId last_released() const { return last_released_; }

 private:
  void AwaitAll(FrameId frame, std::vector<TileFeatures> tiles);

  const int max_open_frames_;
  std::map<std::pair<FrameId, int32_t>, TileFeatures> blocks_;  // ordered by (frame, tile)
  std::map<FrameId, int32_t> num_blocks_;                       // by open frame
  std::set<FrameId> wanted_whole_;                              // open frames of which all candidates are awaited
  std::vector<TileAck> forgotten_;
  FrameId last_released_;
};

}  // namespace tessera
