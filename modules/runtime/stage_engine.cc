#include "runtime/stage_engine.h"

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "core/errors.h"
#include "messages/topics.h"
#include "wire/codec.h"

namespace tessera {
namespace {

constexpr int kMaxMessagesPerBus = 64;  // handled in one round, so that timers and other buses get their turn
constexpr int64_t kStatusPeriodUs = 500'000;
constexpr int64_t kMaxErrorsPerSecond = 10;    // that are logged; all are counted
constexpr size_t kMaxPublishers = 4096;        // of one channel
constexpr int64_t kHeartbeatsAfterValue = 10;  // after so many that told of the last value, they become rarer
constexpr const char* kJournalReplayed = "journal_replayed";  // in STATUS: the share, of a process that was killed

}  // namespace

StageEngine::StageEngine(Setup setup)
    : settings_(std::move(setup.settings)),
      identity_(std::move(setup.identity)),
      stream_settings_(StreamSettings::From(settings_)),
      clock_(std::move(setup.clock)),
      open_bus_(std::move(setup.open_bus)),
      log_(std::move(setup.log)),
      figures_(identity_),
      neighbors_(identity_),
      outgoing_(identity_, stream_settings_),
      incoming_(stream_settings_, *clock_, [this](const std::string& sentence) { ReportError(sentence); }),
      root_(setup.root != nullptr ? setup.root : this) {
  talks_ = BusOf(kHeartbeat)->can_listen();
  heartbeat_due_us_ = status_due_us_ = sent_us_ = clock_->NowUs();
  if (!talks_) return;
  heartbeat_stream_ = Advertise(kHeartbeat);
  repair_stream_ = Advertise(kRepair);
  status_stream_ = Advertise(kStatus);
  const auto on_heartbeat = [this](const Heartbeat& heartbeat, const MessageInfo& info) {
    OnHeartbeat(heartbeat, info);
  };
  Subscribe(kHeartbeat, TypeName<Heartbeat>(), MakeReceiverOf<Heartbeat>(on_heartbeat), Listener::kEngine);
}

std::shared_ptr<Bus> StageEngine::BusOf(const Channel& channel) { return BusAt(UrlOf(channel, settings_)); }

std::shared_ptr<Bus> StageEngine::BusAt(const std::string& url) {
  std::shared_ptr<Bus>& bus = buses_[url];
  if (!bus) bus = open_bus_(url);
  return bus;
}

std::vector<std::shared_ptr<Bus>> StageEngine::buses() const {
  std::vector<std::shared_ptr<Bus>> buses;
  for (const auto& [url, bus] : buses_) buses.push_back(bus);
  return buses;
}

int StageEngine::Advertise(const Channel& channel) {
  if (channel.publishers == Publishers::kOne) {
    if (const auto conflict = neighbors_.ConflictOverChannel(channel.name, clock_->NowUs())) {
      throw std::runtime_error(*conflict);
    }
  }
  const std::shared_ptr<Bus> bus = BusOf(channel);
  const bool is_repaired = channel.delivery != Delivery::kUnordered && talks_ && bus->can_listen();
  const int stream = outgoing_.Add(channel, bus, is_repaired);
  if (is_repaired && !hears_repairs_) {
    hears_repairs_ = true;
    const auto on_request = [this](const RepairRequest& request) { outgoing_.Resend(request, clock_->NowUs()); };
    Subscribe(kRepair, TypeName<RepairRequest>(), MakeReceiverOf<RepairRequest>(on_request), Listener::kEngine);
  }
  // A subscriber that begins to listen now must know that the stream's first messages are meant for it.
  if (channel.delivery == Delivery::kFromNow) SendHeartbeats();
  return stream;
}

void StageEngine::Send(int stream, const Encoder& encode, std::optional<int64_t> source_us) {
  if (stopped_ && stream != status_stream_) return;
  const Channel& channel = outgoing_.channel(stream);
  const MessageHeader header = outgoing_.NextHeader(stream, clock_->WallUs());
  bool is_sent = false;
  try {
    is_sent = outgoing_.Send(stream, encode(header, outgoing_.MaxMessageBytes(stream, clock_->NowUs())), source_us);
  } catch (const InputError& error) {
    return Fail(error.what(), 2);  // the log that is written can't be kept
  }
  if (!is_sent) ReportError("the operating system refused to send a message on " + channel.name);
  if (channel.delivery == Delivery::kUnordered) return;
  ++figures_.num_published;
  sent_us_ = clock_->NowUs();
  soon_due_us_ = sent_us_ + stream_settings_.receiver.repair_us;
}

template <class Value>
void StageEngine::SendValue(int stream, const Value& value) {
  const auto encode = [&](const MessageHeader& first, size_t max_bytes) {
    return EncodeValue(value, first, max_bytes);
  };
  Send(stream, encode, std::nullopt);
}

void StageEngine::Subscribe(const Channel& channel, const char* type, MakeReceiver make_receiver, Listener listener) {
  auto receivers = std::make_shared<std::map<std::string, std::unique_ptr<ValueReceiver>>>();  // by publisher
  ChannelReceiver::Sink sink;
  sink.deliver = [this, receivers, name = channel.name, delivery = channel.delivery, listener,
                  make_receiver = std::move(make_receiver)](ByteView message, const MessageHeader& header,
                                                            int64_t arrival_us) {
    if (listener == Listener::kStage && stage_is_gone_) return;
    if (receivers->size() > kMaxPublishers) receivers->clear();  // forged names
    std::unique_ptr<ValueReceiver>& receiver = (*receivers)[header.publisher];
    if (!receiver) receiver = make_receiver();
    Receive(name, *receiver, delivery, message, header, arrival_us);
  };
  sink.lose = [this, receivers, name = channel.name, unrepaired = channel.unrepaired](const std::string& publisher,
                                                                                      int64_t num_messages) {
    if (const auto it = receivers->find(publisher); it != receivers->end()) it->second->Interrupt();
    if (num_messages == 0) return;
    const std::string which = std::to_string(num_messages) + " messages of " + publisher + " on " + name;
    if (unrepaired == Unrepaired::kRequested) {
      log_(false, which + " did not come; what they said is asked for in another way");
    } else {
      ReportError(which + " are lost: they were asked for again and did not come");
    }
  };
  incoming_.Add(channel, type, BusOf(channel), std::move(sink));
}

void StageEngine::Receive(const std::string& channel, ValueReceiver& receiver, Delivery delivery, ByteView message,
                          const MessageHeader& header, int64_t arrival_us) {
  CallStage("a value on " + channel, [&] {
    const Result<bool> is_whole = receiver.Receive(message, header, arrival_us);
    if (!is_whole) {
      incoming_.Refuse(channel, is_whole.error().sentence);
    } else if (*is_whole && delivery != Delivery::kUnordered) {
      ++figures_.num_received;
    }
  });
}

void StageEngine::KeepJournal(const std::vector<Channel>& inputs, const std::vector<Channel>& outputs) {
  if (stream_settings_.journal_dir.empty()) return;
  const std::string path = stream_settings_.journal_dir + "/" + identity_.name + ".journal";
  journal_ = std::make_unique<Journal>(path, identity_.epoch_us, stream_settings_.journal_bytes);
  if (journal_->is_lost()) {
    return ReportError("it was started again without what it knew: the journal " + path +
                       " was given up, or its disk is broken");
  }
  const auto names_of = [](const std::vector<Channel>& channels) {
    std::set<std::string> names;
    for (const Channel& channel : channels) names.insert(channel.name);
    return names;
  };
  incoming_.KeepJournal(names_of(inputs), journal_.get());
  if (journal_->is_replaying()) outgoing_.BeginReplay(names_of(outputs), journal_->epoch_us());
}

void StageEngine::Remember(const std::string& name, ByteView message) {
  incoming_.WriteJournal(name, message, clock_->NowUs());
}

std::optional<Bytes> StageEngine::Remembered(const std::string& name) {
  if (!is_replaying()) return std::nullopt;
  std::optional<Journal::Entry> entry = journal_->NextOf(name);
  if (!entry) return std::nullopt;
  return std::move(entry->message);
}

// One at a time, so that heartbeats are sent between long steps.
void StageEngine::ReplayOne() {
  if (!is_replaying()) return;
  if (const std::optional<Journal::Entry> entry = journal_->Next()) return incoming_.Replay(*entry);
  outgoing_.EndReplay();
  incoming_.EndReplay();
  figures_.SetValue(kJournalReplayed, journal_->replayed_share());
  SendHeartbeats();  // who lacks the last messages asks for them
  log_(false, "continues where it was when it was killed");
}

StageContext& StageEngine::Join(const std::string& channel_prefix) {
  Settings settings = settings_;
  settings.Override("bus.channel_prefix=" + channel_prefix);
  Setup setup{.settings = std::move(settings),
              .identity = identity_,
              .clock = clock_,
              .open_bus = [this](const std::string& url) { return BusAt(url); },
              .log = log_,
              .root = root_};
  others_.push_back(std::make_unique<StageEngine>(std::move(setup)));
  others_.back()->state_ = state_;
  return others_.back()->context();
}

void StageEngine::SubscribeAll(IncomingStreams::RawHandler handler) {
  incoming_.SetRawHandler(
      [this, handler = std::move(handler)](const std::string& channel, ByteView message, int64_t arrival_us) {
        if (stage_is_gone_) return;
        CallStage("a message on " + channel, [&] { handler(channel, message, arrival_us); });
      });
  for (const Channel& channel : std::initializer_list<Channel>{kHeartbeat, kCamera, kColor, kTileFeatures, kMapDelta}) {
    incoming_.AddAll(BusOf(channel));
  }
}

// While everything is recorded, each extractor's own bus is listened to once its stream is announced.
void StageEngine::ListenToExtractors(const Heartbeat& heartbeat) {
  const std::string prefix = "TILE_";
  for (const StreamHead& head : heartbeat.streams) {
    int extractor = -1;
    const char* end = head.channel.data() + head.channel.size();
    if (!head.channel.starts_with(prefix) ||
        std::from_chars(head.channel.data() + prefix.size(), end, extractor).ptr != end) {
      continue;
    }
    if (extractor >= 0 && extractor < kMaxExtractors) {
      incoming_.AddAll(BusOf(TileTopic(extractor)));
    }
  }
}

void StageEngine::OnHeartbeat(const Heartbeat& heartbeat, const MessageInfo& info) {
  const int64_t now_us = clock_->NowUs();
  // One that has just come must not wait for what an idle process says seldom.
  const bool is_new = neighbors_.OnHeartbeat(info.publisher, info.epoch_us, heartbeat, now_us);
  if (is_new) soon_due_us_ = std::min(soon_due_us_, now_us + stream_settings_.receiver.repair_us);
  if (incoming_.hears_all()) ListenToExtractors(heartbeat);
  incoming_.OnHeartbeat(info.publisher, heartbeat);
  auto conflict = neighbors_.ConflictOverName(now_us);
  for (const StreamHead& head : heartbeat.streams) {
    if (!conflict && outgoing_.IsExclusive(head.channel)) {
      conflict = neighbors_.ConflictOverChannel(head.channel, now_us);
    }
  }
  if (conflict && !stopped_) Fail(*conflict, 1);
}

int64_t StageEngine::HeartbeatPeriodUs(int64_t now_us) const {
  const bool is_idle = now_us - sent_us_ > kHeartbeatsAfterValue * stream_settings_.heartbeat_us;
  return is_idle ? stream_settings_.idle_heartbeat_us : stream_settings_.heartbeat_us;
}

void StageEngine::SendHeartbeats() {
  const int64_t now_us = clock_->NowUs();
  heartbeat_due_us_ = now_us + HeartbeatPeriodUs(now_us);
  soon_due_us_ = INT64_MAX;
  if (!talks_) return;
  for (const Heartbeat& heartbeat : outgoing_.MakeHeartbeats()) {
    SendValue(heartbeat_stream_, heartbeat);
  }
}

void StageEngine::SendStatus(bool is_final) {
  const int64_t now_us = clock_->NowUs();
  status_due_us_ = now_us + kStatusPeriodUs;
  if (!talks_) return;
  const StageState state = exit_status_ != 0 ? StageState::kFailed : state_;
  if (is_final) {
    for (const auto& other : others_) other->SendStatus(true);
  }
  if (is_replaying()) figures_.SetValue(kJournalReplayed, journal_->replayed_share());
  SendValue(status_stream_, figures_.MakeStatus(state, incoming_.counts(), incoming_.num_undecodable(),
                                                incoming_.num_strangers(), now_us, is_final));
}

void StageEngine::ReportError(const std::string& sentence) {
  figures_.last_error = sentence;
  const int64_t now_us = clock_->NowUs();
  if (now_us - errors_since_us_ >= 1'000'000) {
    if (num_errors_ > kMaxErrorsPerSecond) {
      log_(true, std::to_string(num_errors_ - kMaxErrorsPerSecond) + " more errors are not shown");
    }
    errors_since_us_ = now_us;
    num_errors_ = 0;
  }
  if (++num_errors_ <= kMaxErrorsPerSecond) log_(true, sentence);
}

void StageEngine::Fail(const std::string& sentence, int exit_status) {
  if (stopped_) return;
  figures_.last_error = failure_ = sentence;
  exit_status_ = exit_status;
  stopped_ = true;
}

void StageEngine::CallStage(const std::string& where, const std::function<void()>& call) {
  if (is_over()) return;  // the rest of a burst behind what ended it
  try {
    call();
  } catch (const InputError& error) {
    root_->Fail(error.what(), 2);
  } catch (const std::exception& error) {
    root_->Fail(where + " ended the process: " + error.what(), 1);
  }
}

bool StageEngine::HandleMessages() {
  bool some_wait = false;
  for (const auto& bus : buses()) {  // a copy: a handler may open another
    int num_handled = 0;
    while (num_handled < kMaxMessagesPerBus && !stopped_ && bus->HandleOne()) ++num_handled;
    some_wait |= num_handled == kMaxMessagesPerBus;
  }
  return some_wait;
}

void StageEngine::RunTimers() {
  for (size_t i = 0; i < timers_.size() && !stopped_ && !is_replaying(); ++i) {  // by index: a task may add a timer
    const int64_t now_us = clock_->NowUs();
    if (timers_[i].due_us > now_us) continue;
    timers_[i].due_us = now_us + timers_[i].period_us;
    const auto task = timers_[i].task;
    CallStage("a timer", task);
  }
  const int64_t now_us = clock_->NowUs();
  if (now_us >= std::min(heartbeat_due_us_, soon_due_us_)) SendHeartbeats();
  if (now_us >= status_due_us_) SendStatus(false);
}

bool StageEngine::RunIdleTasks() {
  bool again = false;
  wake_us_ = INT64_MAX;
  for (size_t i = 0; i < idle_tasks_.size() && !stopped_; ++i) {  // by index: a task may add one
    const auto task = idle_tasks_[i];
    CallStage("the stage's own work", [&] { again |= task(); });
  }
  return again;
}

void StageEngine::AskForRepairs() {
  for (const RepairRequest& request : incoming_.Poll()) {
    SendValue(repair_stream_, request);
  }
}

// A process of the same name under one robot's prefix does not end the work for the other robots.
void StageEngine::PartFromFailed() {
  for (const auto& other : others_) {
    StageEngine& engine = *other;
    if (!engine.stopped_ || engine.is_silent_) continue;
    engine.Silence();
    ReportError("under the channel prefix `" + engine.stream_settings_.channel_prefix + "`: " + engine.failure_);
  }
}

bool StageEngine::Step() {
  const bool some_wait = HandleMessages();  // of all prefixes: the buses are the same
  ReplayOne();
  RunTimers();
  for (const auto& other : others_) {
    if (!other->is_silent_) other->RunTimers();
  }
  PartFromFailed();
  if (some_wait || stopped_) return !stopped_;
  AskForRepairs();
  for (const auto& other : others_) {
    if (!other->is_silent_) other->AskForRepairs();
  }
  if (is_replaying()) return true;
  bool again = RunIdleTasks();
  for (const auto& other : others_) again |= !other->is_silent_ && other->RunIdleTasks();
  return again;
}

int64_t StageEngine::NextDueUs() const {
  int64_t due_us = std::min({heartbeat_due_us_, soon_due_us_, status_due_us_, wake_us_});
  for (const Timer& timer : timers_) due_us = std::min(due_us, timer.due_us);
  for (const auto& other : others_) {
    if (!other->is_silent_) due_us = std::min(due_us, other->NextDueUs());
  }
  return std::min(due_us, incoming_.next_poll_us().value_or(INT64_MAX));
}

void StageEngine::BeginToRun() {
  state_ = StageState::kRunning;
  SendStatus(false);
  for (const auto& other : others_) other->BeginToRun();
}

int64_t StageEngine::num_values() const {
  int64_t num_values = figures_.num_received + figures_.num_published;
  for (const auto& other : others_) num_values += other->num_values();
  return num_values;
}

void StageEngine::Silence() {
  stopped_ = is_silent_ = true;
  incoming_.Close();
  for (const auto& other : others_) other->Silence();
}

void StageEngine::ForgetStage() {
  stage_is_gone_ = true;
  timers_.clear();
  idle_tasks_.clear();
  wake_us_ = INT64_MAX;
  for (const auto& other : others_) other->ForgetStage();
}

}  // namespace tessera
