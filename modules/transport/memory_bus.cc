#include "transport/memory_bus.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "transport/bus.h"
#include "transport/stage_engine.h"

namespace tessera {
namespace {

using Loses = std::function<bool(const std::string& channel)>;

// Passes everything on but what is to be lost.
class LossyBus : public Bus {
 public:
  LossyBus(std::shared_ptr<Bus> bus, std::shared_ptr<Loses> loses) : bus_(std::move(bus)), loses_(std::move(loses)) {}

  bool Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) override {
    return (*loses_ && (*loses_)(channel)) || bus_->Publish(channel, message, source_us);
  }
  bool can_listen() const override { return true; }
  void Subscribe(const void* owner, const std::string& channel, Handler handler) override {
    bus_->Subscribe(owner, channel, std::move(handler));
  }
  void Unsubscribe(const void* owner) override { bus_->Unsubscribe(owner); }
  int file_descriptor() const override { return bus_->file_descriptor(); }
  bool HandleOne() override { return bus_->HandleOne(); }

 private:
  std::shared_ptr<Bus> bus_;
  std::shared_ptr<Loses> loses_;
};

}  // namespace

struct MemoryBus::Impl {
  struct Member {
    std::unique_ptr<StageContext> context;
    std::shared_ptr<void> stage;  // ends before its context
  };
  // One round of all stages; moves the clock to the next thing that is due if none did anything.
  void Step();
  int64_t NumValues() const;

  Settings settings;
  int64_t now_us = 0;
  std::shared_ptr<Loses> loses = std::make_shared<Loses>();
  std::shared_ptr<Bus> bus;
  std::vector<Member> members;
};

void MemoryBus::Impl::Step() {
  bool did_something = false;
  int64_t due_us = INT64_MAX;
  for (const Member& member : members) {
    StageContext::Impl& engine = member.context->impl();
    did_something |= engine.Step();
    due_us = std::min(due_us, engine.NextDueUs());
  }
  if (!did_something) {
    now_us = std::max(now_us + 1, due_us);
  }
}

// Values that were sent or received, but for what stages say of themselves.
int64_t MemoryBus::Impl::NumValues() const {
  int64_t num_values = 0;
  for (const Member& member : members) {
    const StageStatus& status = member.context->impl().status_;
    num_values += status.num_received + status.num_published;
  }
  return num_values;
}

MemoryBus::MemoryBus(Settings settings) : impl_(std::make_unique<Impl>()) {
  for (const char* key : {"bus.main_url", "bus.camera_url", "bus.work_url", "bus.tile_url"}) {
    settings.Override(std::string(key) + "=memq://");
  }
  impl_->settings = std::move(settings);
  impl_->bus = std::make_shared<LossyBus>(OpenBus("memq://", 0), impl_->loses);
}

MemoryBus::~MemoryBus() {
  for (Impl::Member& member : impl_->members) member.stage.reset();
}

StageContext& MemoryBus::AddContext(const std::string& name, int id) {
  Impl* impl = impl_.get();
  StageContext::Impl::Setup setup;
  setup.settings = impl->settings;
  setup.name = name;
  setup.id = id;
  setup.now_us = [impl] { return impl->now_us; };
  setup.open_bus = [impl](const std::string&) { return impl->bus; };
  impl->members.push_back({std::make_unique<StageContext>(std::make_unique<StageContext::Impl>(std::move(setup))), nullptr});
  return *impl->members.back().context;
}

void MemoryBus::Keep(const std::string& /*name*/, std::shared_ptr<void> stage) {
  impl_->members.back().stage = std::move(stage);
}

void MemoryBus::Kill(const std::string& name) {
  const auto dead = std::find_if(impl_->members.begin(), impl_->members.end(),
                                 [&](const Impl::Member& member) { return member.context->name() == name; });
  if (dead == impl_->members.end()) {
    throw std::invalid_argument("no stage " + name + " to kill");
  }
  dead->context->impl().stopped_ = true;  // what its destructor says is not heard
  dead->stage.reset();
  impl_->members.erase(dead);
}

void MemoryBus::LoseMessages(std::function<bool(const std::string& channel)> lose) { *impl_->loses = std::move(lose); }

bool MemoryBus::RunUntil(const std::function<bool()>& done, double timeout_s) {
  const int64_t end_us = impl_->now_us + static_cast<int64_t>(timeout_s * 1e6);
  while (!done()) {
    if (impl_->now_us > end_us) {
      return false;
    }
    impl_->Step();
  }
  return true;
}

void MemoryBus::RunUntilQuiet(double quiet_s) {
  int64_t num_values = -1;
  int64_t changed_us = impl_->now_us;
  while (impl_->now_us - changed_us < static_cast<int64_t>(quiet_s * 1e6)) {
    impl_->Step();
    if (const int64_t now = impl_->NumValues(); now != num_values) {
      num_values = now;
      changed_us = impl_->now_us;
    }
  }
}

int MemoryBus::exit_status(const std::string& name) const {
  for (const Impl::Member& member : impl_->members) {
    if (member.context->name() == name) return member.context->impl().exit_status_;
  }
  return 0;
}

std::string MemoryBus::failure(const std::string& name) const {
  for (const Impl::Member& member : impl_->members) {
    if (member.context->name() == name) return member.context->impl().failure_;
  }
  return "";
}

}  // namespace tessera
