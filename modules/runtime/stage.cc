#include "runtime/stage.h"

#include <utility>

#include "runtime/stage_engine.h"

namespace tessera {

const Settings& StageContext::settings() const { return engine_.settings_; }
const std::string& StageContext::name() const { return engine_.identity_.name; }
int StageContext::id() const { return engine_.identity_.id; }
int64_t StageContext::epoch_us() const { return engine_.identity_.epoch_us; }
int64_t StageContext::now_us() const { return engine_.clock_->NowUs(); }
int64_t StageContext::wall_us() const { return engine_.clock_->WallUs(); }

StageContext& StageContext::KeepJournal(const std::vector<Channel>& inputs, const std::vector<Channel>& outputs) {
  engine_.KeepJournal(inputs, outputs);
  return *this;
}

bool StageContext::has_lost_journal() const { return engine_.has_lost_journal(); }
bool StageContext::was_restarted() const { return engine_.has_lost_journal() || engine_.is_replaying(); }

bool StageContext::remembers() const { return engine_.remembers(); }
void StageContext::Remember(const std::string& name, ByteView message) { engine_.Remember(name, message); }
std::optional<Bytes> StageContext::Remembered(const std::string& name) { return engine_.Remembered(name); }

int StageContext::AddStream(const Channel& channel) { return engine_.Advertise(channel); }

void StageContext::Send(int stream, const Encoder& encode, std::optional<int64_t> source_us) {
  engine_.Send(stream, encode, source_us);
}

void StageContext::ForgetSent(int stream) { engine_.outgoing_.Forget(stream); }

void StageContext::AddSubscription(const Channel& channel, const char* type, MakeReceiver make_receiver) {
  engine_.Subscribe(channel, type, std::move(make_receiver), StageEngine::Listener::kStage);
}

void StageContext::SubscribeAll(RawHandler handler) { engine_.SubscribeAll(std::move(handler)); }

void StageContext::ContinueBehind(const std::string& channel, ByteView front) {
  engine_.incoming_.ContinueRawBehind(channel, front);
}

void StageContext::Every(std::chrono::milliseconds period, std::function<void()> task) {
  engine_.timers_.push_back({1000 * period.count(), now_us(), std::move(task)});
}

void StageContext::WhenIdle(std::function<bool()> task) { engine_.idle_tasks_.push_back(std::move(task)); }

void StageContext::WakeAt(int64_t time_us) { engine_.wake_us_ = time_us; }

StageContext& StageContext::JoinRobot(const std::string& channel_prefix) { return engine_.Join(channel_prefix); }

bool StageContext::fell_silent() const { return engine_.stopped_; }

void StageContext::Finish() {
  if (finished()) return;
  engine_.state_ = StageState::kFinished;
  engine_.SendHeartbeats();
  engine_.SendStatus(true);
}

bool StageContext::finished() const { return engine_.state_ == StageState::kFinished; }

void StageContext::Fail(const std::string& sentence, int exit_status) { engine_.Fail(sentence, exit_status); }
void StageContext::RecordStep(double milliseconds) { engine_.figures_.RecordStep(milliseconds); }
void StageContext::SetQueue(int64_t num_waiting) { engine_.figures_.queue = num_waiting; }
void StageContext::AddDropped(int64_t num_frames) { engine_.figures_.num_dropped += num_frames; }
void StageContext::SetValue(const std::string& name, double value) { engine_.figures_.SetValue(name, value); }
void StageContext::ReportError(const std::string& sentence) { engine_.ReportError(sentence); }
void StageContext::Info(const std::string& sentence) { engine_.log_(false, sentence); }

}  // namespace tessera
