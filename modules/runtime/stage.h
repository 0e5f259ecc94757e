// What a stage's wiring sees of the world: settings, typed channels, timers, and its own status.
//
//   class TrackerStage {
//    public:
//     explicit TrackerStage(StageContext& context);   // subscribes and advertises; state lives in members
//   };
//   int main(int argc, char** argv) { return tessera::RunStage<tessera::TrackerStage>("tracker", "Estimates ...", argc,
//   argv); }
//
// Handlers, timers and idle tasks all run on one thread, one after the other. A message that can't be used is expected:
// its handler returns a failed Result, which is counted, reported and passed over. What is thrown ends the process with
// one sentence, since it may leave the stage half changed: an InputError with status 2, any other exception with 1.
// STATUS says kFailed then, and the supervisor starts the process again like one that was killed.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "messages/topics.h"
#include "runtime/value_receiver.h"
#include "settings/settings.h"
#include "wire/bytes.h"
#include "wire/codec.h"

namespace tessera {

class StageContext;
class StageEngine;

// Sends values of one type on one channel. Cheap to copy; valid as long as the context.
template <class Value>
class Publisher {
 public:
  Publisher() = default;
  void Publish(const Value& value) const;
  // What was published so far is not needed any longer: it is not kept for repair.
  void Forget() const;

 private:
  friend class StageContext;
  Publisher(StageContext* context, int stream) : context_(context), stream_(stream) {}

  StageContext* context_ = nullptr;
  int stream_ = -1;
};

class StageContext {
 public:
  // Made by the engine that runs the stage.
  explicit StageContext(StageEngine& engine) : engine_(engine) {}
  StageContext(const StageContext&) = delete;
  StageContext& operator=(const StageContext&) = delete;

  const Settings& settings() const;
  const std::string& name() const;  // "extractor_2"
  int id() const;                   // the 2 in it; 0 for a stage that exists once
  int64_t epoch_us() const;         // when it started, wall clock
  // A clock that never jumps, for time-outs and rates only. Tests on a MemoryBus let it run as fast as they like, so
  // a stage asks this one and no other.
  int64_t now_us() const;
  // The wall clock, for measuring only.
  int64_t wall_us() const;

  // What is published on the channels `outputs` is a pure function of what is received on `inputs`, in this order; a
  // stage of which that holds is killed and started again without a trace: what it receives goes into a journal
  // (journal.h), and is given to it once more. To be called before anything is advertised or subscribed to, hence
  // what it returns: this. Timers and idle tasks rest until all of the journal was given. Throws InputError if it can't
  // be kept.
  StageContext& KeepJournal(const std::vector<Channel>& inputs, const std::vector<Channel>& outputs);
  // This process was started again, and its journal was given up before or can't be read: it begins with nothing.
  bool has_lost_journal() const;
  // This process was started again, as one that keeps a journal can tell.
  bool was_restarted() const;

  // What a long step came to, told right after it to whoever has a journal: a later life that gets the same input finds
  // it there, and need not take the step again. nullopt: nothing is known of this step, which has to be taken.
  template <class Value>
  void Remember(const Value& value) {
    if (!remembers()) return;
    const MessageHeader header{.publisher = name(), .epoch_us = epoch_us()};
    Remember(TypeName<Value>(), EncodeValue(value, header, kWhole).front());
  }
  template <class Value>
  std::optional<Value> Remembered() {
    const std::optional<Bytes> message = Remembered(TypeName<Value>());
    const auto header = message ? ReadHeader(*message) : std::nullopt;
    if (!header) return std::nullopt;
    ValueJoiner<Value> joiner;
    const Result<Value*> value = joiner.Add(*message, *header);
    if (!value || *value == nullptr) return std::nullopt;
    return std::move(**value);
  }

  // Values handed to the publisher are numbered, kept for repair, cut into typed parts if large, and sent.
  // Throws std::runtime_error if the channel may have one publisher only and another process is it.
  template <class Value>
  Publisher<Value> Advertise(const Topic<Value>& topic) {
    return {this, AddStream(topic)};
  }

  // `handler` gets every value of every publisher of the channel, per publisher in order and once. It takes the value
  // (const Value&, or Value to keep it), or (value, const MessageInfo&), and returns nothing or a Result<>: a failed
  // one refuses the value, which is then counted, reported and passed over. Messages that were lost on the way are
  // asked for again; those that do not come are counted in STATUS, and the stream continues behind them.
  template <class Value, class Handler>
  void Subscribe(const Topic<Value>& topic, Handler handler) {
    AddSubscription(topic, TypeName<Value>(), MakeReceiverOf<Value>(std::move(handler)));
  }

  // For recording: `handler` gets every message of every bus, also of each extractor's, as it was sent (`channel` with
  // prefix); streams from their first message on, in order and repaired. HEARTBEAT and REPAIR are left out: played
  // again, they would speak of publishers that are gone.
  using RawHandler = std::function<void(const std::string& channel, ByteView message, int64_t arrival_us)>;
  void SubscribeAll(RawHandler handler);
  // This process was started again, and its earlier life has recorded this message (`channel` with prefix; the first
  // 256 bytes are enough): its stream continues behind it. To be called before SubscribeAll, in order.
  void ContinueBehind(const std::string& channel, ByteView front);

  // Calls `task` about every `period`. For liveness and output only; no result may depend on it.
  void Every(std::chrono::milliseconds period, std::function<void()> task);
  // Runs `task` whenever no message waits: again at once while it returns true, else after the next message or timer.
  // The main loop of a stage that makes its own work, such as the camera.
  void WhenIdle(std::function<bool()> task);
  // Idle tasks run at this time of now_us() at the latest, once. A later call replaces it.
  void WakeAt(int64_t time_us);

  // This process under another robot's channel prefix: channels, streams, STATUS, HEARTBEAT and REPAIR of its own, on
  // the same buses, thread and clock. It lives as long as this context. If another process of this name is there
  // already, the joined context falls silent, which is reported here, and this one continues: so it should listen for
  // two heartbeats before it advertises. Throws InputError if the prefix can't be one.
  StageContext& JoinRobot(const std::string& channel_prefix);
  bool fell_silent() const;

  // The stage has sent its last value. It stays to repair what others missed until it is told to stop (SIGTERM,
  // SIGINT), and says `kFinished` in its status.
  void Finish();
  bool finished() const;

  // Ends the process's loop with this exit status after one sentence. Only a last status is sent after that.
  void Fail(const std::string& sentence, int exit_status = 1);

  // Own figures for STATUS.
  void RecordStep(double milliseconds);
  void SetQueue(int64_t num_waiting);
  void AddDropped(int64_t num_frames);
  void SetValue(const std::string& name, double value);
  void ReportError(const std::string& sentence);
  void Info(const std::string& sentence);

 private:
  template <class Value>
  friend class Publisher;
  // Encodes a value into messages of at most `max_bytes` each.
  using Encoder = std::function<std::vector<Bytes>(const MessageHeader& first, size_t max_bytes)>;

  static constexpr size_t kWhole = size_t{1} << 30;  // of one message

  bool remembers() const;
  void Remember(const std::string& name, ByteView message);
  std::optional<Bytes> Remembered(const std::string& name);
  int AddStream(const Channel& channel);
  void Send(int stream, const Encoder& encode, std::optional<int64_t> source_us);
  void ForgetSent(int stream);
  void AddSubscription(const Channel& channel, const char* type, MakeReceiver make_receiver);

  StageEngine& engine_;
};

template <class Value>
void Publisher<Value>::Publish(const Value& value) const {
  const auto encode = [&value](const MessageHeader& first, size_t max_bytes) {
    return EncodeValue(value, first, max_bytes);
  };
  context_->Send(stream_, encode, SourceTime(value));
}

template <class Value>
void Publisher<Value>::Forget() const {
  context_->ForgetSent(stream_);
}

// Measures a step from construction to destruction and records it.
class StepTimer {
 public:
  explicit StepTimer(StageContext& context) : context_(context), begin_(std::chrono::steady_clock::now()) {}
  ~StepTimer() {
    context_.RecordStep(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin_).count());
  }
  StepTimer(const StepTimer&) = delete;
  StepTimer& operator=(const StepTimer&) = delete;

 private:
  StageContext& context_;
  std::chrono::steady_clock::time_point begin_;
};

// The main of every stage: arguments (--settings FILE, --set section.key=value, --name NAME, --id N, --help), checks of
// the machine and the network with clear sentences, signals, the loop, the orderly end. Returns the exit status.
int RunStageMain(const std::string& stage, const std::string& description, int argc, char** argv,
                 const std::function<std::shared_ptr<void>(StageContext&)>& make_stage);

template <class Stage>
int RunStage(const std::string& stage, const std::string& description, int argc, char** argv) {
  return RunStageMain(stage, description, argc, argv,
                      [](StageContext& context) { return std::make_shared<Stage>(context); });
}

}  // namespace tessera
