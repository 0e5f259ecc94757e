// Wiring of the recorder: every message of every bus into one LCM log.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "runtime/stage.h"
#include "wire/log_file.h"

namespace tessera {

class RecorderStage {
 public:
  explicit RecorderStage(StageContext& context);
  // The log takes its name, unless it is not whole.
  ~RecorderStage();
  RecorderStage(const RecorderStage&) = delete;
  RecorderStage& operator=(const RecorderStage&) = delete;

 private:
  // Behind what an earlier life has recorded.
  void Continue(const std::string& path);
  void Write(const std::string& channel, ByteView message, int64_t arrival_us);
  // The run continues without a recording.
  void GiveUp(const std::string& problem);

  StageContext& context_;
  std::unique_ptr<LogFileWriter> log_;  // null: given up
  int64_t time_us_ = 0;                 // of the last event: time never runs back in a log
};

}  // namespace tessera
