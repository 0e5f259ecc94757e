// How a stage says that it has sent its last value.
#pragma once

#include <cstdint>

namespace tessera {

// The stages that end their streams, in the order in which frames pass through them.
enum class StageKind { kCamera, kDispatcher, kReassembler, kTracker, kMapper };

// The only stage of this kind has sent all it will ever send: the last frame of the stream is num_frames - 1 (the first
// need not be 0: frames keep their source's numbers), and of all frames that reached it, it and those before it dropped
// some: more than num_frames, if what was dropped came last.
struct EndOfStream {
  StageKind stage = StageKind::kCamera;
  int64_t num_frames = 0;
  int64_t num_dropped = 0;
  // Camera: number of the first frame that it sent. Tracker: keyframes sent; mapper: deltas sent: others wait for the
  // last. The rest: 0.
  int64_t num_values = 0;

  bool operator==(const EndOfStream&) const = default;
};

}  // namespace tessera
