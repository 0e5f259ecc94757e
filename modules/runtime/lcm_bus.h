// A bus that is an LCM instance.
#pragma once

#include <lcm/lcm.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "runtime/bus.h"

namespace tessera {

class LcmBus : public Bus {
 public:
  // `burst_bytes`: sent in one go at most, before a short pause lets receivers drain their buffers; 0: no limit.
  LcmBus(const std::string& url, size_t burst_bytes);
  ~LcmBus() override;
  LcmBus(const LcmBus&) = delete;
  LcmBus& operator=(const LcmBus&) = delete;

  bool Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) override;
  bool can_listen() const override { return true; }
  void Subscribe(const void* owner, const std::string& channel, Handler handler) override;
  void Unsubscribe(const void* owner) override;
  int file_descriptor() const override { return file_descriptor_; }
  bool HandleOne() override;

 private:
  struct Subscriber {
    const void* owner = nullptr;
    Handler handler;
  };
  // All subscribers of one LCM subscription, which lives as long as the bus.
  struct Topic {
    std::vector<std::shared_ptr<Subscriber>> subscribers;
  };
  static void OnMessage(const lcm_recv_buf_t* buffer, const char* channel, void* topic);
  void Pace(size_t num_bytes);

  std::string url_;
  lcm_t* lcm_;
  int file_descriptor_ = -1;
  std::map<std::string, std::unique_ptr<Topic>> topics_;  // by channel; "": all
  size_t burst_bytes_;
  double recent_bytes_ = 0.0;  // sent and, by estimate, not yet taken out of the receivers' buffers
  std::chrono::steady_clock::time_point paced_;
};

}  // namespace tessera
