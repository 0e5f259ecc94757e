// What stands behind a StageContext: buses, streams, timers and the stage's figures. RunStageMain drives it by the real
// clock and poll(); MemoryBus by a clock of its own.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "settings/settings.h"
#include "transport/bus.h"
#include "transport/channel_receiver.h"
#include "transport/codec.h"
#include "transport/stage.h"
#include "transport/stream_history.h"

namespace tessera {

// A subscription of whatever type.
class Inlet {
 public:
  virtual ~Inlet() = default;
  virtual void OnMessage(ByteView message, int64_t arrival_us) = 0;
  virtual void OnHeartbeat(const std::string& publisher, int64_t epoch_us, const StreamHead& head) = 0;
  virtual std::vector<RepairRequest> Poll() = 0;
  virtual std::optional<int64_t> next_poll_us() const = 0;
  virtual StreamCounts counts() const = 0;
  virtual const std::string& channel() const = 0;
};

struct StageContext::Impl {
  struct Setup {
    Settings settings;
    std::string name;
    int id = 0;
    std::function<int64_t()> now_us;       // never jumps
    std::function<std::shared_ptr<Bus>(const std::string& url)> open_bus;
  };
  explicit Impl(Setup setup);
  ~Impl();

  struct Outlet {
    Channel channel;
    std::string wire_name;
    std::shared_ptr<Bus> bus;
    StreamHistory history;
    bool is_exclusive = false;
    bool is_repaired = false;
  };
  struct Timer {
    int64_t period_us = 0;
    int64_t due_us = 0;
    std::function<void()> task;
  };

  Bus& BusOf(const Channel& channel);
  std::shared_ptr<Bus> SharedBusOf(const Channel& channel);
  std::string WireName(const Channel& channel) const { return prefix_ + channel.name; }
  void Listen(const Channel& channel, std::unique_ptr<Inlet> inlet);
  void ListenForRepairs();
  void ListenForHeartbeats();
  void OnHeartbeat(const Heartbeat& heartbeat, const MessageHeader& header);
  void OnRepair(const RepairRequest& request);
  void SendHeartbeat();
  void SendStatus();
  void CallSafely(const std::string& where, const std::function<void()>& call);

  // One round: handles what waits, runs what is due. Returns whether anything was done.
  bool Step();
  // When Step has something to do if nothing arrives.
  int64_t NextDueUs() const;
  bool CanListenAnywhere() const;

  Setup setup_;
  std::string prefix_;
  int64_t epoch_us_ = 0;
  size_t max_message_bytes_ = 0;
  std::map<std::string, std::shared_ptr<Bus>> buses_;  // by URL
  std::vector<std::unique_ptr<Outlet>> outlets_;
  std::vector<std::unique_ptr<Inlet>> inlets_;
  std::vector<Timer> timers_;
  std::vector<std::function<bool()>> idle_tasks_;
  int heartbeat_outlet_ = -1, repair_outlet_ = -1, status_outlet_ = -1;
  bool hears_repairs_ = false, hears_heartbeats_ = false;
  bool finished_ = false;
  bool stopped_ = false;
  int exit_status_ = 0;
  std::string failure_;
  StageStatus status_;
  std::vector<float> steps_ms_;
};

}  // namespace tessera
