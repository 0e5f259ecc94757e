// Values that stages exchange about their work rather than about the world.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/ids.h"

namespace tessera {

// An extractor says that it lives: at start, and twice a second.
struct ExtractorReady {
  int32_t extractor = 0;      // its id, the n of TILE_<n>
  int64_t epoch_us = 0;       // when it started: a changed epoch means that its jobs died with its predecessor
  int64_t num_jobs_done = 0;  // since it started, for all robots
  int32_t num_robots = 1;     // that have given it work of late: each gets its share of it
};

// The reassembler has the candidates of these tiles of one frame: nobody needs to work on them again, as long as this
// reassembler lives. Its first one names no tiles: it has nothing of what was sent before.
struct TileAck {
  FrameId frame;
  std::vector<int32_t> tiles;
  bool wants_all = false;  // they are not there: what was left out of them may be needed, too
  // Of a frame that was cut and is released: the lowest priority that was chosen, by level (features/selection.h).
  std::vector<int32_t> lowest_priority;
};

enum class StageState { kStarting = 0, kRunning = 1, kFinished = 2, kFailed = 3 };

// Statistics of the wall time of a stage's own step, milliseconds.
struct StepStatistics {
  int64_t count = 0;
  double mean_ms = 0, median_ms = 0, p95_ms = 0, p99_ms = 0, max_ms = 0;
};

// What a stage says of itself twice a second, and once when it ends.
struct StageStatus {
  std::string name;  // "tracker", "extractor_0"
  std::string host;
  std::string version;  // of the program
  int32_t pid = 0;
  int64_t epoch_us = 0;  // when it started
  StageState state = StageState::kStarting;
  int64_t num_received = 0;     // values delivered to it
  int64_t num_published = 0;    // values it sent
  int64_t num_dropped = 0;      // frames it dropped on purpose (the dispatcher's full queue)
  int64_t num_repaired = 0;     // messages that were lost on the way and came after being asked for again
  int64_t num_lost = 0;         // messages that never came
  int64_t num_undecodable = 0;  // messages whose bytes or values made no sense
  int64_t num_strangers = 0;    // messages that no member of the run sent, or that were replayed
  int64_t queue = 0;            // values waiting for it now
  StepStatistics step;
  double cpu_percent = 0;  // since the last status; 100 is one core
  double cpu_s = 0;        // since it started
  double rss_mb = 0;
  std::string last_error;                              // one sentence; empty if none
  std::vector<std::pair<std::string, double>> values;  // the stage's own figures, such as ("keyframes", 12)
};

}  // namespace tessera
