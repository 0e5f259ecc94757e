// What stands behind a StageContext: buses, streams, timers and the stage's figures. RunStageMain drives it by the
// computer's clock and poll(), tests by a clock of their own.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bus.h"
#include "runtime/clock.h"
#include "runtime/incoming_streams.h"
#include "runtime/journal.h"
#include "runtime/neighbors.h"
#include "runtime/outgoing_streams.h"
#include "runtime/stage.h"
#include "runtime/stage_figures.h"
#include "runtime/stream_settings.h"
#include "settings/settings.h"

namespace tessera {

class StageEngine {
 public:
  struct Setup {
    Settings settings;
    StageIdentity identity;
    std::shared_ptr<const Clock> clock;
    std::function<std::shared_ptr<Bus>(const std::string& url)> open_bus;
    std::function<void(bool is_error, const std::string& sentence)> log;
    StageEngine* root = nullptr;  // whose process this one is part of, under another prefix; null: its own
  };
  // Opens the main bus and listens there for other processes. Throws as OpenBus does.
  explicit StageEngine(Setup setup);
  StageEngine(const StageEngine&) = delete;
  StageEngine& operator=(const StageEngine&) = delete;

  // What the stage sees of this.
  StageContext& context() { return context_; }

  // --- for StageContext ---
  std::shared_ptr<Bus> BusOf(const Channel& channel);
  // Returns the number of the new stream. Throws std::runtime_error if the channel already has its only publisher.
  int Advertise(const Channel& channel);
  using Encoder = std::function<std::vector<Bytes>(const MessageHeader& first, size_t max_bytes)>;
  void Send(int stream, const Encoder& encode, std::optional<int64_t> source_us);
  // A stage that is gone receives nothing; the engine's own subscriptions continue.
  enum class Listener { kEngine, kStage };
  void Subscribe(const Channel& channel, const char* type, MakeReceiver make_receiver, Listener listener);
  void SubscribeAll(IncomingStreams::RawHandler handler);
  void KeepJournal(const std::vector<Channel>& inputs, const std::vector<Channel>& outputs);
  // Whether Remember has somewhere to put it. A life that repeats another has nothing new to remember.
  bool remembers() const { return journal_ && !journal_->is_lost() && !journal_->is_replaying(); }
  void Remember(const std::string& name, ByteView message);
  std::optional<Bytes> Remembered(const std::string& name);
  bool has_lost_journal() const { return journal_ && journal_->is_lost(); }
  bool is_replaying() const { return journal_ && journal_->is_replaying(); }
  StageContext& Join(const std::string& channel_prefix);
  void ReportError(const std::string& sentence);
  void Fail(const std::string& sentence, int exit_status);
  // Runs code of the stage. What it throws ends the whole process, since the stage may be half changed.
  void CallStage(const std::string& where, const std::function<void()>& call);

  // --- for its driver ---
  // One round: handles messages that wait, runs what is due; when none waits, asks for what is missing and runs
  // idle tasks. False if there is nothing left to do before something arrives or NextDueUs().
  bool Step();
  int64_t NextDueUs() const;
  // The stage has been made: STATUS says that it runs.
  void BeginToRun();
  // Values sent and received, but for what stages say of themselves; under all prefixes.
  int64_t num_values() const;
  std::vector<std::shared_ptr<Bus>> buses() const;
  void SendHeartbeats();
  void SendStatus(bool is_final);
  // Ends silently: receives and sends nothing from now on.
  void Silence();
  // The stage is about to be destroyed: none of its tasks and handlers is called again.
  void ForgetStage();

  struct Timer {
    int64_t period_us = 0;
    int64_t due_us = 0;
    std::function<void()> task;
  };

  const Settings settings_;
  const StageIdentity identity_;
  const StreamSettings stream_settings_;
  const std::shared_ptr<const Clock> clock_;
  std::function<std::shared_ptr<Bus>(const std::string& url)> open_bus_;
  std::function<void(bool is_error, const std::string& sentence)> log_;
  std::map<std::string, std::shared_ptr<Bus>> buses_;  // by URL
  StageFigures figures_;
  Neighbors neighbors_;
  std::unique_ptr<Journal> journal_;  // null: none is kept
  OutgoingStreams outgoing_;
  IncomingStreams incoming_;
  std::vector<Timer> timers_;
  std::vector<std::function<bool()>> idle_tasks_;
  int64_t wake_us_ = INT64_MAX;  // for them
  StageState state_ = StageState::kStarting;
  bool stopped_ = false;
  bool stage_is_gone_ = false;
  int exit_status_ = 0;
  std::string failure_;

 private:
  std::shared_ptr<Bus> BusAt(const std::string& url);
  void OnHeartbeat(const Heartbeat& heartbeat, const MessageInfo& info);
  void ListenToExtractors(const Heartbeat& heartbeat);
  void Receive(const std::string& channel, ValueReceiver& receiver, Delivery delivery, ByteView message,
               const MessageHeader& header, int64_t arrival_us);
  template <class Value>
  void SendValue(int stream, const Value& value);
  bool is_over() const { return stopped_ || root_->stopped_; }
  bool HandleMessages();
  void ReplayOne();
  int64_t HeartbeatPeriodUs(int64_t now_us) const;
  void RunTimers();
  void AskForRepairs();
  bool RunIdleTasks();
  void PartFromFailed();

  StageEngine* const root_;
  bool talks_ = false;  // the main bus has listeners
  int heartbeat_stream_ = -1;
  int repair_stream_ = -1;
  int status_stream_ = -1;
  bool hears_repairs_ = false;
  int64_t heartbeat_due_us_ = 0;     // the next regular one
  int64_t soon_due_us_ = INT64_MAX;  // the one soon after a value was sent, or another process appeared
  int64_t sent_us_ = 0;              // when the last value was sent, or this process began
  int64_t status_due_us_ = 0;
  int64_t num_errors_ = 0;  // reported within the second that began at
  int64_t errors_since_us_ = 0;
  bool is_silent_ = false;
  StageContext context_{*this};
  std::vector<std::unique_ptr<StageEngine>> others_;  // this process under other prefixes; driven by this one
};

}  // namespace tessera
