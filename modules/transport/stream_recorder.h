// Writes everything that travels on the buses into one LCM log: each message once, with losses repaired as for any
// subscriber. lcm-logger keeps 30 messages per queue and drops the rest of a burst; this does not.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "transport/stage.h"

namespace tessera {

class StreamRecorder {
 public:
  // Listens on the main, camera and work bus and on the buses of the first `num_extractors` extractors. Throws
  // InputError if the log can't be written. The context must outlive it.
  StreamRecorder(StageContext& context, const std::string& path, int num_extractors);
  // Closes the log, which then takes its name.
  ~StreamRecorder();
  StreamRecorder(const StreamRecorder&) = delete;
  StreamRecorder& operator=(const StreamRecorder&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
