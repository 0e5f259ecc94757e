#include "runtime/stage_engine.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "wire/codec.h"

namespace tessera {
namespace {

constexpr int kMaxMessagesPerBus = 64;  // handled in one round, so that timers and other buses get their turn
constexpr int64_t kStatusPeriodUs = 500'000;
constexpr int64_t kMaxErrorsPerSecond = 10;  // that are logged; all are counted

}  // namespace

StageContext::Impl::Impl(Setup setup)
    : settings_(std::move(setup.settings)),
      identity_(std::move(setup.identity)),
      stream_settings_(StreamSettings::From(settings_)),
      clock_(std::move(setup.clock)),
      open_bus_(std::move(setup.open_bus)),
      log_(std::move(setup.log)),
      figures_(identity_),
      neighbours_(identity_),
      outgoing_(identity_, stream_settings_),
      incoming_(stream_settings_, *clock_, [this](const std::string& sentence) { ReportError(sentence); }) {
  talks_ = BusOf(kHeartbeatChannel)->can_listen();
  heartbeat_due_us_ = status_due_us_ = clock_->NowUs();
  if (!talks_) return;
  heartbeat_stream_ = Advertise(kHeartbeatChannel, Delivery::kUnordered, false);
  repair_stream_ = Advertise(kRepairChannel, Delivery::kUnordered, false);
  status_stream_ = Advertise(kStatusChannel, Delivery::kUnordered, false);
  Subscribe<Heartbeat>(kHeartbeatChannel, [this](const Heartbeat& heartbeat, const MessageHeader& header, int64_t) {
    OnHeartbeat(heartbeat, header);
  });
}

std::shared_ptr<Bus> StageContext::Impl::BusOf(const Channel& channel) { return BusAt(UrlOf(channel, settings_)); }

std::shared_ptr<Bus> StageContext::Impl::BusAt(const std::string& url) {
  std::shared_ptr<Bus>& bus = buses_[url];
  if (!bus) bus = open_bus_(url);
  return bus;
}

std::vector<std::shared_ptr<Bus>> StageContext::Impl::buses() const {
  std::vector<std::shared_ptr<Bus>> buses;
  for (const auto& [url, bus] : buses_) buses.push_back(bus);
  return buses;
}

int StageContext::Impl::Advertise(const Channel& channel, Delivery delivery, bool is_exclusive) {
  if (is_exclusive) {
    if (const auto conflict = neighbours_.ConflictOverChannel(channel.name, clock_->NowUs())) {
      throw std::runtime_error(*conflict);
    }
  }
  const std::shared_ptr<Bus> bus = BusOf(channel);
  const bool is_repaired = delivery != Delivery::kUnordered && talks_ && bus->can_listen();
  const int stream = outgoing_.Add(channel, bus, is_repaired, is_exclusive);
  if (is_repaired && !hears_repairs_) {
    hears_repairs_ = true;
    Subscribe<RepairRequest>(kRepairChannel, [this](const RepairRequest& request, const MessageHeader&, int64_t) {
      outgoing_.Resend(request, clock_->NowUs());
    });
  }
  // Who begins to listen now must know that the stream's first messages are meant for him.
  if (delivery == Delivery::kFromNow) SendHeartbeats();
  return stream;
}

StageContext& StageContext::Impl::Join(const std::string& channel_prefix) {
  Settings settings = settings_;
  settings.Override("bus.channel_prefix=" + channel_prefix);
  Setup setup{.settings = std::move(settings),
              .identity = identity_,
              .clock = clock_,
              .open_bus = [this](const std::string& url) { return BusAt(url); },
              .log = log_};
  others_.push_back(std::make_unique<StageContext>(std::make_unique<Impl>(std::move(setup))));
  others_.back()->impl().state_ = state_;
  return *others_.back();
}

void StageContext::Impl::SubscribeAll(const IncomingStreams::RawHandler& handler) {
  const auto safely = [this, handler](const std::string& channel, ByteView message, int64_t arrival_us) {
    CallSafely("a message on " + channel, [&] { handler(channel, message, arrival_us); });
  };
  incoming_.SetRawHandler(safely);
  for (const Channel& channel : {kHeartbeatChannel, kCameraChannel, kTileFeaturesChannel}) {
    incoming_.AddAll(BusOf(channel));
  }
}

// While everything is recorded, each extractor's own bus is listened to once its stream is announced.
void StageContext::Impl::ListenToExtractors(const Heartbeat& heartbeat) {
  const std::string prefix = "TILE_";
  for (const StreamHead& head : heartbeat.streams) {
    int extractor = -1;
    const char* end = head.channel.data() + head.channel.size();
    if (!head.channel.starts_with(prefix) ||
        std::from_chars(head.channel.data() + prefix.size(), end, extractor).ptr != end) {
      continue;
    }
    if (extractor >= 0 && extractor < kMaxExtractors) {
      CallSafely(head.channel, [&] { incoming_.AddAll(BusOf(TileChannel(extractor))); });
    }
  }
}

void StageContext::Impl::OnHeartbeat(const Heartbeat& heartbeat, const MessageHeader& header) {
  const int64_t now_us = clock_->NowUs();
  neighbours_.OnHeartbeat(header, heartbeat, now_us);
  if (incoming_.hears_all()) ListenToExtractors(heartbeat);
  incoming_.OnHeartbeat(header, heartbeat);
  auto conflict = neighbours_.ConflictOverName(now_us);
  for (const StreamHead& head : heartbeat.streams) {
    if (!conflict && outgoing_.IsExclusive(head.channel)) {
      conflict = neighbours_.ConflictOverChannel(head.channel, now_us);
    }
  }
  if (conflict && !stopped_) Fail(*conflict, 1);
}

void StageContext::Impl::SendHeartbeats() {
  const int64_t now_us = clock_->NowUs();
  heartbeat_due_us_ = now_us + stream_settings_.heartbeat_us;
  soon_due_us_ = INT64_MAX;
  if (!talks_) return;
  for (const Heartbeat& heartbeat : outgoing_.MakeHeartbeats()) {
    Send(heartbeat_stream_, heartbeat);
  }
}

void StageContext::Impl::SendStatus(bool is_final) {
  const int64_t now_us = clock_->NowUs();
  status_due_us_ = now_us + kStatusPeriodUs;
  if (!talks_) return;
  const StageState state = exit_status_ != 0 ? StageState::kFailed : state_;
  if (is_final) {
    for (const auto& other : others_) other->impl().SendStatus(true);
  }
  Send(status_stream_, figures_.MakeStatus(state, incoming_.counts(), incoming_.num_undecodable(), now_us, is_final));
}

void StageContext::Impl::ReportError(const std::string& sentence) {
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

void StageContext::Impl::Fail(const std::string& sentence, int exit_status) {
  if (stopped_) return;
  figures_.last_error = failure_ = sentence;
  exit_status_ = exit_status;
  stopped_ = true;
}

void StageContext::Impl::CallSafely(const std::string& where, const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    ReportError(where + ": " + error.what());
  }
}

bool StageContext::Impl::HandleMessages() {
  bool some_wait = false;
  for (const auto& bus : buses()) {  // a copy: a handler may open another
    int num_handled = 0;
    while (num_handled < kMaxMessagesPerBus && !stopped_ && bus->HandleOne()) ++num_handled;
    some_wait |= num_handled == kMaxMessagesPerBus;
  }
  return some_wait;
}

void StageContext::Impl::RunTimers() {
  for (size_t i = 0; i < timers_.size() && !stopped_; ++i) {  // by index: a task may add a timer
    const int64_t now_us = clock_->NowUs();
    if (timers_[i].due_us > now_us) continue;
    timers_[i].due_us = now_us + timers_[i].period_us;
    const auto task = timers_[i].task;
    CallSafely("a timer's task", task);
  }
  const int64_t now_us = clock_->NowUs();
  if (now_us >= std::min(heartbeat_due_us_, soon_due_us_)) SendHeartbeats();
  if (now_us >= status_due_us_) SendStatus(false);
}

bool StageContext::Impl::RunIdleTasks() {
  bool again = false;
  for (size_t i = 0; i < idle_tasks_.size() && !stopped_; ++i) {  // by index: a task may add one
    const auto task = idle_tasks_[i];
    CallSafely("the stage's main loop", [&] { again |= task(); });
  }
  return again;
}

void StageContext::Impl::AskForRepairs() {
  for (const RepairRequest& request : incoming_.Poll()) {
    Send(repair_stream_, request);
  }
}

// One robot's namesake of this process is no reason to fail the others.
void StageContext::Impl::PartFromFailed() {
  for (const auto& other : others_) {
    Impl& engine = other->impl();
    if (!engine.stopped_ || engine.is_silent_) continue;
    engine.Silence();
    ReportError("under the channel prefix `" + engine.stream_settings_.channel_prefix + "`: " + engine.failure_);
  }
}

bool StageContext::Impl::Step() {
  const bool some_wait = HandleMessages();  // of all prefixes: the buses are the same
  RunTimers();
  for (const auto& other : others_) {
    if (!other->impl().is_silent_) other->impl().RunTimers();
  }
  PartFromFailed();
  if (some_wait || stopped_) return !stopped_;
  AskForRepairs();
  for (const auto& other : others_) {
    if (!other->impl().is_silent_) other->impl().AskForRepairs();
  }
  bool again = RunIdleTasks();
  for (const auto& other : others_) again |= !other->impl().is_silent_ && other->impl().RunIdleTasks();
  return again;
}

int64_t StageContext::Impl::NextDueUs() const {
  int64_t due_us = std::min({heartbeat_due_us_, soon_due_us_, status_due_us_});
  for (const Timer& timer : timers_) due_us = std::min(due_us, timer.due_us);
  for (const auto& other : others_) {
    if (!other->impl().is_silent_) due_us = std::min(due_us, other->impl().NextDueUs());
  }
  return std::min(due_us, incoming_.next_poll_us().value_or(INT64_MAX));
}

void StageContext::Impl::BeginToRun() {
  state_ = StageState::kRunning;
  SendStatus(false);
  for (const auto& other : others_) other->impl().BeginToRun();
}

int64_t StageContext::Impl::num_values() const {
  int64_t num_values = figures_.num_received + figures_.num_published;
  for (const auto& other : others_) num_values += other->impl().num_values();
  return num_values;
}

void StageContext::Impl::Silence() {
  stopped_ = is_silent_ = true;
  incoming_.Close();
  for (const auto& other : others_) other->impl().Silence();
}

void StageContext::Impl::ForgetStage() {
  stage_is_gone_ = true;
  timers_.clear();
  idle_tasks_.clear();
  for (const auto& other : others_) other->impl().ForgetStage();
}

}  // namespace tessera
