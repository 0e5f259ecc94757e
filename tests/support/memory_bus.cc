#include "support/memory_bus.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "runtime/lcm_bus.h"
#include "runtime/stage_engine.h"

namespace tessera {
namespace {

constexpr int64_t kWallStartUs = 1'600'000'000'000'000;  // any time will do

class TestClock : public Clock {
 public:
  int64_t NowUs() const override { return now_us; }
  int64_t WallUs() const override { return kWallStartUs + now_us; }

  int64_t now_us = 0;
};

using Loses = std::function<bool(const std::string& channel)>;

// Passes everything on but what is to be lost, and lets it arrive by the test's clock.
class TestBus : public Bus {
 public:
  TestBus(std::shared_ptr<const TestClock> clock, std::shared_ptr<const Loses> loses)
      : clock_(std::move(clock)), loses_(std::move(loses)), bus_("memq://", 0) {}

  bool Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) override {
    return (*loses_ && (*loses_)(channel)) || bus_.Publish(channel, message, source_us);
  }
  bool can_listen() const override { return true; }
  void Subscribe(const void* owner, const std::string& channel, Handler handler) override {
    bus_.Subscribe(owner, channel,
                   [clock = clock_, handler = std::move(handler)](const std::string& name, ByteView message, int64_t) {
                     handler(name, message, clock->WallUs());
                   });
  }
  void Unsubscribe(const void* owner) override { bus_.Unsubscribe(owner); }
  int file_descriptor() const override { return bus_.file_descriptor(); }
  bool HandleOne() override { return bus_.HandleOne(); }

 private:
  std::shared_ptr<const TestClock> clock_;
  std::shared_ptr<const Loses> loses_;
  LcmBus bus_;
};

}  // namespace

struct MemoryBus::Impl {
  struct Member {
    std::unique_ptr<StageEngine> engine;
    std::shared_ptr<void> stage;  // ends before its engine
    bool has_ended = false;       // the stage failed, and has said so
  };
  // One round of all stages; moves the clock to the next thing that is due if none did anything.
  void Step();
  int64_t NumValues() const;
  const Member* Find(const std::string& name) const;

  Settings settings;
  std::shared_ptr<TestClock> clock = std::make_shared<TestClock>();
  std::shared_ptr<Loses> loses = std::make_shared<Loses>();
  std::shared_ptr<Bus> bus = std::make_shared<TestBus>(clock, loses);
  std::vector<Member> members;
  int64_t num_started = 0;
};

void MemoryBus::Impl::Step() {
  bool did_something = false;
  int64_t due_us = INT64_MAX;
  for (Member& member : members) {
    StageEngine& engine = *member.engine;
    if (member.has_ended) continue;
    if (engine.stopped_) {
      engine.SendStatus(true);
      engine.Silence();
      member.has_ended = true;
      continue;
    }
    did_something |= engine.Step();
    due_us = std::min(due_us, engine.NextDueUs());
  }
  if (!did_something) {
    clock->now_us = std::max(clock->now_us + 1, due_us == INT64_MAX ? 0 : due_us);
  }
}

// Values that were sent or received, but for what stages say of themselves.
int64_t MemoryBus::Impl::NumValues() const {
  int64_t num_values = 0;
  for (const Member& member : members) {
    num_values += member.engine->num_values();
  }
  return num_values;
}

const MemoryBus::Impl::Member* MemoryBus::Impl::Find(const std::string& name) const {
  const auto it = std::find_if(members.begin(), members.end(),
                               [&](const Member& member) { return member.engine->context().name() == name; });
  return it == members.end() ? nullptr : &*it;
}

MemoryBus::MemoryBus(Settings settings) : impl_(std::make_unique<Impl>()) { impl_->settings = std::move(settings); }

MemoryBus::~MemoryBus() {
  for (Impl::Member& member : impl_->members) member.stage.reset();
}

StageContext& MemoryBus::AddContext(const std::string& name, int id, const std::vector<std::string>& assignments) {
  Impl* impl = impl_.get();
  Settings settings = impl->settings;
  for (const std::string& assignment : assignments) settings.Override(assignment);
  StageEngine::Setup setup{.settings = std::move(settings),
                           .identity = {.name = name,
                                        .id = id,
                                        .epoch_us = impl->clock->WallUs() + ++impl->num_started,
                                        .host = "memory",
                                        .pid = static_cast<int32_t>(impl->num_started)},
                           .clock = impl->clock,
                           .open_bus = [impl](const std::string&) { return impl->bus; },
                           .log = [](bool, const std::string&) {}};
  impl->members.push_back({std::make_unique<StageEngine>(std::move(setup)), nullptr});
  impl->members.back().engine->state_ = StageState::kRunning;
  return impl->members.back().engine->context();
}

void MemoryBus::Keep(const std::string& name, std::shared_ptr<void> stage) {
  const auto newest = std::find_if(impl_->members.rbegin(), impl_->members.rend(),
                                   [&](const Impl::Member& member) { return member.engine->context().name() == name; });
  newest->stage = std::move(stage);
}

void MemoryBus::Kill(const std::string& name) {
  const Impl::Member* dead = impl_->Find(name);
  if (dead == nullptr) {
    throw std::invalid_argument("no stage " + name + " to kill");
  }
  dead->engine->Silence();  // what its destructor says is not heard
  impl_->members[static_cast<size_t>(dead - impl_->members.data())].stage.reset();
  impl_->members.erase(impl_->members.begin() + (dead - impl_->members.data()));
}

void MemoryBus::LoseMessages(std::function<bool(const std::string& channel)> lose) { *impl_->loses = std::move(lose); }

bool MemoryBus::RunUntil(const std::function<bool()>& done, double timeout_s) {
  const int64_t end_us = impl_->clock->now_us + static_cast<int64_t>(timeout_s * 1e6);
  while (!done()) {
    if (impl_->clock->now_us > end_us) {
      return false;
    }
    impl_->Step();
  }
  return true;
}

void MemoryBus::RunUntilQuiet(double quiet_s) {
  const auto quiet_us = static_cast<int64_t>(quiet_s * 1e6);
  int64_t num_values = -1;
  int64_t changed_us = impl_->clock->now_us;
  while (impl_->clock->now_us - changed_us < quiet_us) {
    impl_->Step();
    if (const int64_t now = impl_->NumValues(); now != num_values) {
      num_values = now;
      changed_us = impl_->clock->now_us;
    }
  }
}

Bus& MemoryBus::bus() { return *impl_->bus; }

int MemoryBus::exit_status(const std::string& name) const {
  const Impl::Member* member = impl_->Find(name);
  return member == nullptr ? 0 : member->engine->exit_status_;
}

std::string MemoryBus::failure(const std::string& name) const {
  const Impl::Member* member = impl_->Find(name);
  return member == nullptr ? "" : member->engine->failure_;
}

}  // namespace tessera
