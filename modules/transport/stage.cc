#include "transport/stage.h"

#include <sys/resource.h>
#include <unistd.h>

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "core/errors.h"
#include "transport/stage_engine.h"

namespace tessera {
namespace {

constexpr int kMaxMessagesPerStep = 64;

int64_t WallUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::string HostName() {
  char name[256] = {};
  gethostname(name, sizeof(name) - 1);
  return name;
}

StreamReceiverOptions ReceiverOptions(const Settings& settings, Delivery delivery) {
  StreamReceiverOptions options;
  options.repair_us = 1000LL * settings.Get<int>("stream.repair_ms");
  options.give_up_us = 1000LL * settings.Get<int>("stream.give_up_ms");
  options.starts_now = delivery == Delivery::kFromNow;
  return options;
}

// Joins parts to values, and gives them to the handler of one Subscribe().
template <class Value>
class TypedInlet : public Inlet {
 public:
  TypedInlet(StageContext::Impl& engine, std::string channel, std::function<void(const Value&, const MessageInfo&)> handler)
      : engine_(engine),
        receiver_(std::move(channel), ReceiverOptions(engine.setup_.settings, kDelivery<Value>),
                  {[this](ByteView message, const MessageHeader& header, int64_t arrival_us) { Join(message, header, arrival_us); },
                   [this](const std::string& publisher, int64_t) { Interrupt(publisher); }}),
        handler_(std::move(handler)) {}

  void OnMessage(ByteView message, int64_t arrival_us) override {
    const std::optional<MessageHeader> header = ReadHeader(message);
    if (!header) {
      Refuse("bytes that are no message of Tessera");
    } else if (kDelivery<Value> == Delivery::kUnordered) {
      Join(message, *header, arrival_us);
    } else if (!receiver_.OnMessage(*header, message, arrival_us, engine_.setup_.now_us())) {
      Refuse("a message whose number can't be true");
    }
  }
  void OnHeartbeat(const std::string& publisher, int64_t epoch_us, const StreamHead& head) override {
    if (kDelivery<Value> != Delivery::kUnordered && head.channel == receiver_.channel()) {
      receiver_.OnHeartbeat(publisher, epoch_us, head, engine_.setup_.now_us());
    }
  }
  std::vector<RepairRequest> Poll() override { return receiver_.Poll(engine_.setup_.now_us()); }
  std::optional<int64_t> next_poll_us() const override { return receiver_.next_poll_us(); }
  StreamCounts counts() const override { return receiver_.counts(); }
  const std::string& channel() const override { return receiver_.channel(); }

 private:
  struct Joining {
    ValueJoiner<Value> joiner;
    int64_t arrival_us = 0;
  };

  void Join(ByteView message, const MessageHeader& header, int64_t arrival_us) {
    auto& joining = joining_[header.publisher];
    if (!joining) joining = std::make_unique<Joining>();
    if (header.part == 0) joining->arrival_us = arrival_us;
    switch (joining->joiner.Add(message, header)) {
      case ValueJoiner<Value>::Result::kIncomplete:
        return;
      case ValueJoiner<Value>::Result::kRefused:
        return Refuse(joining->joiner.problem());
      case ValueJoiner<Value>::Result::kComplete:
        break;
    }
    if (kDelivery<Value> != Delivery::kUnordered) ++engine_.status_.num_received;
    const MessageInfo info{header.publisher, header.epoch_us, header.sequence, header.publish_us, joining->arrival_us};
    engine_.CallSafely("a value on " + channel(), [&] { handler_(joining->joiner.value(), info); });
  }
  void Interrupt(const std::string& publisher) {
    if (const auto it = joining_.find(publisher); it != joining_.end() && it->second->joiner.Interrupt()) {
      spdlog::warn("{}: a value of {} is lost: parts of it never came", channel(), publisher);
    }
  }
  void Refuse(const std::string& problem) {
    ++engine_.status_.num_undecodable;
    engine_.status_.last_error = "refused on " + channel() + ": " + problem;
    if (engine_.status_.num_undecodable <= 10) spdlog::warn("{}", engine_.status_.last_error);
  }

  StageContext::Impl& engine_;
  ChannelReceiver receiver_;
  std::function<void(const Value&, const MessageInfo&)> handler_;
  std::map<std::string, std::unique_ptr<Joining>> joining_;  // by publisher
};

StepStatistics StatisticsOf(std::vector<float> steps_ms) {
  StepStatistics statistics;
  statistics.count = static_cast<int64_t>(steps_ms.size());
  if (steps_ms.empty()) return statistics;
  std::sort(steps_ms.begin(), steps_ms.end());
  const auto quantile = [&](double q) {
    return static_cast<double>(steps_ms[static_cast<size_t>(q * static_cast<double>(steps_ms.size() - 1))]);
  };
  double sum = 0.0;
  for (const float step : steps_ms) sum += static_cast<double>(step);
  statistics.mean_ms = sum / static_cast<double>(steps_ms.size());
  statistics.median_ms = quantile(0.5);
  statistics.p95_ms = quantile(0.95);
  statistics.p99_ms = quantile(0.99);
  statistics.max_ms = static_cast<double>(steps_ms.back());
  return statistics;
}

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double ResidentMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

template <class Value>
int AddOutlet(StageContext::Impl& engine, const Channel& channel, bool is_exclusive) {
  const bool is_repaired = kDelivery<Value> != Delivery::kUnordered && engine.BusOf(channel).can_listen();
  const auto history_bytes = static_cast<size_t>(is_repaired ? engine.setup_.settings.Get<int>("stream.history_bytes") : 0);
  engine.outlets_.push_back(std::make_unique<StageContext::Impl::Outlet>(
      StageContext::Impl::Outlet{channel, engine.WireName(channel), engine.SharedBusOf(channel), StreamHistory(history_bytes),
                                 is_exclusive, is_repaired}));
  if (is_repaired) engine.ListenForRepairs();
  if (is_exclusive) engine.ListenForHeartbeats();
  return static_cast<int>(engine.outlets_.size()) - 1;
}

template <class Value>
void Send(StageContext::Impl& engine, int stream, const Value& value) {
  StageContext::Impl::Outlet& outlet = *engine.outlets_[static_cast<size_t>(stream)];
  MessageHeader header;
  header.publisher = engine.setup_.name;
  header.epoch_us = engine.epoch_us_;
  header.sequence = outlet.history.next();
  header.publish_us = WallUs();
  for (Bytes& message : EncodeValue(value, header, engine.max_message_bytes_)) {
    outlet.bus->Publish(outlet.wire_name, outlet.history.Append(std::move(message)), SourceTime(value));
  }
}

}  // namespace

StageContext::Impl::Impl(Setup setup) : setup_(std::move(setup)) {
  prefix_ = setup_.settings.Get<std::string>("bus.channel_prefix");
  max_message_bytes_ = static_cast<size_t>(setup_.settings.Get<int>("bus.max_message_bytes"));
  epoch_us_ = WallUs();
  status_.name = setup_.name;
  status_.host = HostName();
  status_.pid = static_cast<int32_t>(getpid());
  status_.epoch_us = epoch_us_;
  if (BusOf(kStatusChannel).can_listen()) {
    heartbeat_outlet_ = AddOutlet<Heartbeat>(*this, kHeartbeatChannel, false);
    repair_outlet_ = AddOutlet<RepairRequest>(*this, kRepairChannel, false);
    status_outlet_ = AddOutlet<StageStatus>(*this, kStatusChannel, false);
    const int64_t heartbeat_us = 1000LL * setup_.settings.Get<int>("stream.heartbeat_ms");
    timers_.push_back({heartbeat_us, setup_.now_us(), [this] { SendHeartbeat(); }});
    timers_.push_back({500'000, setup_.now_us(), [this] { SendStatus(); }});
  }
}

StageContext::Impl::~Impl() {
  for (auto& [url, bus] : buses_) bus->Unsubscribe(this);
}

std::shared_ptr<Bus> StageContext::Impl::SharedBusOf(const Channel& channel) {
  const std::string url = UrlOf(channel, setup_.settings);
  std::shared_ptr<Bus>& bus = buses_[url];
  if (!bus) bus = setup_.open_bus(url);
  return bus;
}

Bus& StageContext::Impl::BusOf(const Channel& channel) { return *SharedBusOf(channel); }

void StageContext::Impl::Listen(const Channel& channel, std::unique_ptr<Inlet> inlet) {
  Inlet* raw = inlet.get();
  inlets_.push_back(std::move(inlet));
  BusOf(channel).Subscribe(this, WireName(channel), [raw](const std::string&, ByteView message, int64_t arrival_us) {
    raw->OnMessage(message, arrival_us);
  });
}

void StageContext::Impl::ListenForRepairs() {
  if (hears_repairs_) return;
  hears_repairs_ = true;
  Listen(kRepairChannel, std::make_unique<TypedInlet<RepairRequest>>(
                             *this, kRepairChannel.name,
                             [this](const RepairRequest& request, const MessageInfo&) { OnRepair(request); }));
}

void StageContext::Impl::ListenForHeartbeats() {
  if (hears_heartbeats_) return;
  hears_heartbeats_ = true;
  Listen(kHeartbeatChannel, std::make_unique<TypedInlet<Heartbeat>>(
                                *this, kHeartbeatChannel.name, [this](const Heartbeat& heartbeat, const MessageInfo& info) {
                                  MessageHeader header;
                                  header.publisher = info.publisher;
                                  header.epoch_us = info.epoch_us;
                                  OnHeartbeat(heartbeat, header);
                                }));
}

void StageContext::Impl::OnHeartbeat(const Heartbeat& heartbeat, const MessageHeader& header) {
  const bool is_own = header.publisher == setup_.name && header.epoch_us == epoch_us_;
  for (const StreamHead& head : heartbeat.streams) {
    for (const auto& inlet : inlets_) {
      if (inlet->channel() == head.channel) inlet->OnHeartbeat(header.publisher, header.epoch_us, head);
    }
    if (is_own || !head.is_exclusive || header.epoch_us > epoch_us_) continue;
    const bool is_mine = std::any_of(outlets_.begin(), outlets_.end(), [&](const auto& outlet) {
      return outlet->is_exclusive && outlet->channel.name == head.channel;
    });
    if (is_mine && !stopped_) {
      failure_ = "channel " + head.channel + " already has a publisher: " + header.publisher + " (pid " +
                 std::to_string(heartbeat.pid) + " on " + heartbeat.host +
                 "); stop that stack, or start this one on other ports (--port N)";
      exit_status_ = 1;
      stopped_ = true;
    }
  }
}

void StageContext::Impl::OnRepair(const RepairRequest& request) {
  if (request.publisher != setup_.name || request.epoch_us != epoch_us_) return;
  for (const auto& outlet : outlets_) {
    if (!outlet->is_repaired || outlet->channel.name != request.channel) continue;
    for (const SequenceRange& range : request.ranges) {
      const int64_t last = std::min(range.last, outlet->history.next() - 1);
      for (int64_t sequence = std::max(range.first, outlet->history.first()); sequence <= last; ++sequence) {
        if (const Bytes* message = outlet->history.Resend(sequence, setup_.now_us(), 5000)) {
          outlet->bus->Publish(outlet->wire_name, *message, std::nullopt);
        }
      }
    }
  }
}

void StageContext::Impl::SendHeartbeat() {
  if (heartbeat_outlet_ < 0) return;  // a log is written: nobody listens
  Heartbeat heartbeat;
  heartbeat.host = status_.host;
  heartbeat.pid = status_.pid;
  for (const auto& outlet : outlets_) {
    if (outlet->is_repaired) {
      heartbeat.streams.push_back({outlet->channel.name, outlet->history.first(), outlet->history.next(), outlet->is_exclusive});
    }
  }
  if (!heartbeat.streams.empty()) Send(*this, heartbeat_outlet_, heartbeat);
}

void StageContext::Impl::SendStatus() {
  if (status_outlet_ < 0) return;
  status_.num_repaired = 0;
  status_.num_lost = 0;
  for (const auto& inlet : inlets_) {
    status_.num_repaired += inlet->counts().num_repaired;
    status_.num_lost += inlet->counts().num_lost;
  }
  const double cpu_s = CpuSeconds();
  status_.cpu_percent = std::max(0.0, 100.0 * (cpu_s - status_.cpu_s) / 0.5);
  status_.cpu_s = cpu_s;
  status_.rss_mb = ResidentMb();
  status_.step = StatisticsOf(steps_ms_);
  status_.state = exit_status_ != 0 ? StageState::kFailed : finished_ ? StageState::kFinished : StageState::kRunning;
  Send(*this, status_outlet_, status_);
}

void StageContext::Impl::CallSafely(const std::string& where, const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    status_.last_error = where + ": " + error.what();
    spdlog::error("{}", status_.last_error);
  }
}

bool StageContext::Impl::Step() {
  bool did_something = false;
  std::vector<std::shared_ptr<Bus>> buses;  // a handler may open another
  for (const auto& [url, bus] : buses_) buses.push_back(bus);
  for (const auto& bus : buses) {
    for (int i = 0; i < kMaxMessagesPerStep && bus->HandleOne(); ++i) did_something = true;
  }
  const int64_t now_us = setup_.now_us();
  for (size_t i = 0; i < timers_.size(); ++i) {
    if (timers_[i].due_us > now_us) continue;
    timers_[i].due_us = now_us + timers_[i].period_us;
    const auto task = timers_[i].task;
    CallSafely("a timer", task);
  }
  if (did_something) return true;
  for (const auto& inlet : inlets_) {
    for (const RepairRequest& request : inlet->Poll()) Send(*this, repair_outlet_, request);
  }
  for (size_t i = 0; i < idle_tasks_.size(); ++i) {
    bool again = false;
    const auto task = idle_tasks_[i];
    CallSafely("the main loop", [&] { again = task(); });
    did_something |= again;
  }
  return did_something;
}

int64_t StageContext::Impl::NextDueUs() const {
  int64_t due_us = setup_.now_us() + 100'000;
  for (const Timer& timer : timers_) due_us = std::min(due_us, timer.due_us);
  for (const auto& inlet : inlets_) {
    if (const auto poll_us = inlet->next_poll_us()) due_us = std::min(due_us, *poll_us);
  }
  return due_us;
}

template <class Value>
void Publisher<Value>::Publish(const Value& value) const {
  StageContext::Impl& engine = context_->impl();
  if (engine.stopped_) return;
  Send(engine, stream_, value);
  if (kDelivery<Value> != Delivery::kUnordered) ++engine.status_.num_published;
}

StageContext::StageContext(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StageContext::~StageContext() = default;
const Settings& StageContext::settings() const { return impl_->setup_.settings; }
const std::string& StageContext::name() const { return impl_->setup_.name; }
int StageContext::id() const { return impl_->setup_.id; }
int64_t StageContext::epoch_us() const { return impl_->epoch_us_; }
int64_t StageContext::now_us() const { return impl_->setup_.now_us(); }

template <class Value>
Publisher<Value> StageContext::Advertise(const Channel& channel, Publishers publishers) {
  Publisher<Value> publisher;
  publisher.context_ = this;
  publisher.stream_ = AddOutlet<Value>(*impl_, channel, publishers == Publishers::kOne);
  return publisher;
}

template <class Value>
void StageContext::Subscribe(const Channel& channel, std::function<void(const Value&, const MessageInfo&)> handler) {
  if (kDelivery<Value> != Delivery::kUnordered) impl_->ListenForHeartbeats();
  impl_->Listen(channel, std::make_unique<TypedInlet<Value>>(*impl_, channel.name, std::move(handler)));
}

void StageContext::Every(std::chrono::milliseconds period, std::function<void()> task) {
  impl_->timers_.push_back({1000 * period.count(), now_us(), std::move(task)});
}
void StageContext::WhenIdle(std::function<bool()> task) { impl_->idle_tasks_.push_back(std::move(task)); }

void StageContext::Finish() {
  impl_->finished_ = true;
  impl_->SendHeartbeat();
  impl_->SendStatus();
}
bool StageContext::finished() const { return impl_->finished_; }

void StageContext::Fail(const std::string& sentence, int exit_status) {
  impl_->failure_ = sentence;
  impl_->exit_status_ = exit_status;
  impl_->stopped_ = true;
}

void StageContext::RecordStep(double milliseconds) { impl_->steps_ms_.push_back(static_cast<float>(milliseconds)); }
void StageContext::SetQueue(int64_t num_waiting) { impl_->status_.queue = num_waiting; }
void StageContext::AddDropped(int64_t num_frames) { impl_->status_.num_dropped += num_frames; }
void StageContext::SetValue(const std::string& name, double value) {
  auto& values = impl_->status_.values;
  const auto it = std::find_if(values.begin(), values.end(), [&](const auto& entry) { return entry.first == name; });
  if (it == values.end()) {
    values.emplace_back(name, value);
  } else {
    it->second = value;
  }
}
void StageContext::ReportError(const std::string& sentence) {
  impl_->status_.last_error = sentence;
  spdlog::error("{}", sentence);
}
void StageContext::Info(const std::string& sentence) { spdlog::info("{}", sentence); }

// Every type that stages exchange.
#define TESSERA_INSTANTIATE(Value)                                                                     \
  template class Publisher<Value>;                                                                     \
  template Publisher<Value> StageContext::Advertise<Value>(const Channel& channel, Publishers publishers); \
  template void StageContext::Subscribe<Value>(const Channel& channel,                                 \
                                               std::function<void(const Value&, const MessageInfo&)> handler);
TESSERA_INSTANTIATE(CameraFrame)
TESSERA_INSTANTIATE(CameraCalibration)
TESSERA_INSTANTIATE(GroundTruthPose)
TESSERA_INSTANTIATE(EndOfStream)
TESSERA_INSTANTIATE(TileJob)
TESSERA_INSTANTIATE(TileFeatures)
TESSERA_INSTANTIATE(TileAck)
TESSERA_INSTANTIATE(FeatureFrame)
TESSERA_INSTANTIATE(PoseEstimate)
TESSERA_INSTANTIATE(KeyframeObservation)
TESSERA_INSTANTIATE(ExtractorReady)
TESSERA_INSTANTIATE(StageStatus)
#undef TESSERA_INSTANTIATE

bool StageContext::Impl::CanListenAnywhere() const {
  return std::any_of(buses_.begin(), buses_.end(), [](const auto& entry) { return entry.second->can_listen(); });
}

}  // namespace tessera
