// Wiring of the recorder: every message of every bus into one LCM log.
#pragma once

#include <cstdint>
#include <string>

#include "runtime/stage.h"
#include "wire/log_file.h"

namespace tessera {

class RecorderStage {
 public:
  explicit RecorderStage(StageContext& context);
  // The log takes its name.
  ~RecorderStage();
  RecorderStage(const RecorderStage&) = delete;
  RecorderStage& operator=(const RecorderStage&) = delete;

 private:
  void Write(const std::string& channel, ByteView message, int64_t arrival_us);

  StageContext& context_;
  LogFileWriter log_;
  int64_t time_us_ = 0;  // of the last event: time never runs back in a log
};

}  // namespace tessera
