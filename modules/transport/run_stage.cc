#include <poll.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "core/errors.h"
#include "transport/stage.h"
#include "transport/stage_engine.h"
#include "transport/udp_check.h"

namespace tessera {
namespace {

std::atomic<bool> g_told_to_stop{false};
void OnSignal(int) { g_told_to_stop = true; }

int64_t SteadyUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void CheckCpu() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("bmi2") || !__builtin_cpu_supports("fma")) {
    throw InputError("this CPU lacks AVX2 (x86-64-v3), for which Tessera is compiled; use a machine from 2015 or later");
  }
#endif
}

void CheckReceiveBuffer(const Settings& settings) {
  const int asked = settings.Get<int>("bus.receive_buffer_bytes");
  const int granted = GrantedReceiveBuffer(asked);
  if (granted < asked) {
    spdlog::warn("the kernel grants a receive buffer of {} bytes where {} are asked for; images may have to be sent again. "
                 "Raise it: sudo sysctl -w net.core.rmem_max={}", granted, asked, asked);
  }
}

// Sleeps until a message waits or something is due.
void Wait(StageContext::Impl& engine) {
  std::vector<pollfd> fds;
  for (const auto& [url, bus] : engine.buses_) {
    if (bus->file_descriptor() >= 0) fds.push_back({bus->file_descriptor(), POLLIN, 0});
  }
  const int64_t wait_us = std::clamp<int64_t>(engine.NextDueUs() - SteadyUs(), 0, 100'000);
  const timespec timeout{0, static_cast<long>(wait_us * 1000)};
  ppoll(fds.data(), fds.size(), &timeout, nullptr);
}

}  // namespace

int RunStageMain(const std::string& stage, const std::string& description, int argc, char** argv,
                 const std::function<std::shared_ptr<void>(StageContext&)>& make_stage) {
  CLI::App app(description);
  std::string settings_file = TESSERA_SOURCE_DIR "/config/default.yaml";
  std::string user_file;
  std::vector<std::string> assignments;
  StageContext::Impl::Setup setup;
  setup.name = stage;
  app.add_option("--settings", settings_file, "file with every setting");
  app.add_option("--set", assignments, "section.key=value, may be repeated");
  app.add_option("--name", setup.name, "name of this process on the bus");
  app.add_option("--id", setup.id, "number of this extractor: it listens on TILE_<id>")->check(CLI::Range(0, kMaxExtractors - 1));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  spdlog::set_default_logger(spdlog::stderr_logger_st(setup.name));
  spdlog::set_pattern("%H:%M:%S.%e %n %l: %v");
  std::signal(SIGTERM, OnSignal);
  std::signal(SIGINT, OnSignal);
  std::signal(SIGPIPE, SIG_IGN);
  try {
    CheckCpu();
    setup.settings = Settings::LoadDefaults(settings_file);
    for (const std::string& assignment : assignments) setup.settings.Override(assignment);
    CheckReceiveBuffer(setup.settings);
    setup.now_us = SteadyUs;
    const int buffer_bytes = setup.settings.Get<int>("bus.receive_buffer_bytes");
    setup.open_bus = [buffer_bytes](const std::string& url) { return OpenBus(url, buffer_bytes); };
    StageContext context(std::make_unique<StageContext::Impl>(std::move(setup)));
    StageContext::Impl& engine = context.impl();
    std::shared_ptr<void> instance = make_stage(context);
    while (!g_told_to_stop && !engine.stopped_) {
      if (!engine.Step()) Wait(engine);
      if (engine.finished_ && !engine.CanListenAnywhere()) break;  // writing a log: nobody will ask for anything
    }
    instance.reset();
    engine.SendStatus();
    for (const auto& [url, bus] : engine.buses_) bus->Close();
    if (!engine.failure_.empty()) std::fprintf(stderr, "tessera-%s: %s\n", stage.c_str(), engine.failure_.c_str());
    return engine.exit_status_;
  } catch (const InputError& error) {
    std::fprintf(stderr, "tessera-%s: %s\n", stage.c_str(), error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tessera-%s: %s\n", stage.c_str(), error.what());
    return 1;
  }
}

}  // namespace tessera
