#include "runtime/stage.h"

#include <utility>

#include "runtime/stage_engine.h"
#include "wire/codec.h"
#include "wire/value_types.h"

namespace tessera {

StageContext::StageContext(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StageContext::~StageContext() = default;

const Settings& StageContext::settings() const { return impl_->settings_; }
const std::string& StageContext::name() const { return impl_->identity_.name; }
int StageContext::id() const { return impl_->identity_.id; }
int64_t StageContext::epoch_us() const { return impl_->identity_.epoch_us; }
int64_t StageContext::now_us() const { return impl_->clock_->NowUs(); }

template <class Value>
void Publisher<Value>::Publish(const Value& value) const {
  context_->impl().Send(stream_, value);
}

template <class Value>
void Publisher<Value>::Forget() const {
  context_->impl().outgoing_.Forget(stream_);
}

template <class Value>
Publisher<Value> StageContext::Advertise(const Channel& channel, Publishers publishers) {
  Publisher<Value> publisher;
  publisher.context_ = this;
  publisher.stream_ = impl_->Advertise(channel, kDelivery<Value>, publishers == Publishers::kOne);
  return publisher;
}

template <class Value>
void StageContext::Subscribe(const Channel& channel, std::function<void(const Value&, const MessageInfo&)> handler) {
  impl_->Subscribe<Value>(channel, [engine = impl_.get(), handler = std::move(handler)](
                                       const Value& value, const MessageHeader& header, int64_t arrival_us) {
    if (engine->stage_is_gone_) return;
    handler(value, {.publisher = header.publisher,
                    .epoch_us = header.epoch_us,
                    .sequence = header.sequence,
                    .publish_us = header.publish_us,
                    .arrival_us = arrival_us});
  });
}

void StageContext::SubscribeAll(RawHandler handler) {
  impl_->SubscribeAll([engine = impl_.get(), handler = std::move(handler)](const std::string& channel, ByteView message,
                                                                           int64_t arrival_us) {
    if (!engine->stage_is_gone_) handler(channel, message, arrival_us);
  });
}

void StageContext::Every(std::chrono::milliseconds period, std::function<void()> task) {
  impl_->timers_.push_back({1000 * period.count(), now_us(), std::move(task)});
}

void StageContext::WhenIdle(std::function<bool()> task) { impl_->idle_tasks_.push_back(std::move(task)); }

StageContext& StageContext::JoinRobot(const std::string& channel_prefix) { return impl_->Join(channel_prefix); }

bool StageContext::fell_silent() const { return impl_->stopped_; }

void StageContext::Finish() {
  if (finished()) return;
  impl_->state_ = StageState::kFinished;
  impl_->SendHeartbeats();
  impl_->SendStatus(true);
}

bool StageContext::finished() const { return impl_->state_ == StageState::kFinished; }

void StageContext::Fail(const std::string& sentence, int exit_status) { impl_->Fail(sentence, exit_status); }
void StageContext::RecordStep(double milliseconds) { impl_->figures_.RecordStep(milliseconds); }
void StageContext::SetQueue(int64_t num_waiting) { impl_->figures_.queue = num_waiting; }
void StageContext::AddDropped(int64_t num_frames) { impl_->figures_.num_dropped += num_frames; }
void StageContext::SetValue(const std::string& name, double value) { impl_->figures_.SetValue(name, value); }
void StageContext::ReportError(const std::string& sentence) { impl_->ReportError(sentence); }
void StageContext::Info(const std::string& sentence) { impl_->log_(false, sentence); }

#define TESSERA_STAGE_VALUE(Value)                                                      \
  template class Publisher<Value>;                                                      \
  template Publisher<Value> StageContext::Advertise<Value>(const Channel&, Publishers); \
  template void StageContext::Subscribe<Value>(const Channel&, std::function<void(const Value&, const MessageInfo&)>);
TESSERA_FOR_EACH_VALUE_TYPE(TESSERA_STAGE_VALUE)
#undef TESSERA_STAGE_VALUE

}  // namespace tessera
