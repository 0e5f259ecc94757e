// How a stage says that it has sent its last value.
#pragma once

#include <cstdint>
#include <string>

namespace tessera {

// The stage `stage` has sent all it will ever send: the last frame of the stream is num_frames - 1 (the first need not
// be 0: frames keep their source's numbers), and of all that came to it, it and those before it dropped some.
struct EndOfStream {
  std::string stage;
  int64_t num_frames = 0;
  int64_t num_dropped = 0;
  int64_t num_values = 0;  // tracker: keyframes sent; mapper: deltas sent. Others wait for the last; the rest: 0
};

}  // namespace tessera
