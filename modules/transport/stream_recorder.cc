#include "transport/stream_recorder.h"

#include <set>
#include <utility>

#include "transport/channel_receiver.h"
#include "transport/log_file.h"
#include "transport/stage_engine.h"

namespace tessera {
namespace {

// Channels whose values stand for themselves: written as they come.
bool IsUnordered(const std::string& channel) {
  static const std::set<std::string> kUnordered = {kStatusChannel.name, kHeartbeatChannel.name, kRepairChannel.name,
                                                   kExtractorReadyChannel.name};
  return kUnordered.contains(channel);
}

// One channel's way into the log.
class RawInlet : public Inlet {
 public:
  RawInlet(StageContext::Impl& engine, std::string channel, LogFileWriter& log)
      : engine_(engine),
        log_(log),
        receiver_(std::move(channel), {},
                  {[this](ByteView message, const MessageHeader&, int64_t arrival_us) { Write(message, arrival_us); },
                   [](const std::string&, int64_t) {}}) {}

  void OnMessage(ByteView message, int64_t arrival_us) override {
    const auto header = ReadHeader(message);
    if (!header || IsUnordered(channel())) {
      Write(message, arrival_us);  // a foreign message is recorded as it is
    } else {
      receiver_.OnMessage(*header, message, arrival_us, engine_.setup_.now_us());
    }
  }
  void OnHeartbeat(const std::string& publisher, int64_t epoch_us, const StreamHead& head) override {
    receiver_.OnHeartbeat(publisher, epoch_us, head, engine_.setup_.now_us());
  }
  std::vector<RepairRequest> Poll() override { return receiver_.Poll(engine_.setup_.now_us()); }
  std::optional<int64_t> next_poll_us() const override { return receiver_.next_poll_us(); }
  StreamCounts counts() const override { return receiver_.counts(); }
  const std::string& channel() const override { return receiver_.channel(); }

 private:
  void Write(ByteView message, int64_t arrival_us) {
    ++engine_.status_.num_received;
    log_.Write(arrival_us, engine_.prefix_ + channel(), message);
  }

  StageContext::Impl& engine_;
  LogFileWriter& log_;
  ChannelReceiver receiver_;
};

}  // namespace

struct StreamRecorder::Impl {
  Impl(StageContext::Impl& stage_engine, const std::string& path) : engine(stage_engine), log(path) {}
  void ListenTo(const std::shared_ptr<Bus>& bus);
  void OnMessage(const std::string& wire_name, ByteView message, int64_t arrival_us);

  StageContext::Impl& engine;
  LogFileWriter log;
  std::map<std::string, Inlet*> inlets;  // by channel, owned by the engine
  std::set<Bus*> heard;
};

void StreamRecorder::Impl::ListenTo(const std::shared_ptr<Bus>& bus) {
  if (!heard.insert(bus.get()).second) return;  // several kinds of channels may share a bus
  bus->Subscribe(&engine, "", [this](const std::string& wire_name, ByteView message, int64_t arrival_us) {
    OnMessage(wire_name, message, arrival_us);
  });
}

void StreamRecorder::Impl::OnMessage(const std::string& wire_name, ByteView message, int64_t arrival_us) {
  if (!wire_name.starts_with(engine.prefix_)) return;  // another robot's
  const std::string channel = wire_name.substr(engine.prefix_.size());
  Inlet*& inlet = inlets[channel];
  if (inlet == nullptr) {
    auto made = std::make_unique<RawInlet>(engine, channel, log);
    inlet = made.get();
    engine.inlets_.push_back(std::move(made));
  }
  engine.CallSafely("recording " + channel, [&] { inlet->OnMessage(message, arrival_us); });
}

StreamRecorder::StreamRecorder(StageContext& context, const std::string& path, int num_extractors)
    : impl_(std::make_unique<Impl>(context.impl(), path)) {
  StageContext::Impl& engine = context.impl();
  engine.ListenForHeartbeats();
  for (const Channel* channel : {&kStatusChannel, &kCameraChannel, &kTileFeaturesChannel}) {
    impl_->ListenTo(engine.SharedBusOf(*channel));
  }
  for (int extractor = 0; extractor < num_extractors; ++extractor) {
    impl_->ListenTo(engine.SharedBusOf(TileChannel(extractor)));
  }
}

StreamRecorder::~StreamRecorder() {
  for (Bus* bus : impl_->heard) bus->Unsubscribe(&impl_->engine);
  impl_->engine.CallSafely("closing the log", [this] { impl_->log.Close(); });
}

}  // namespace tessera
