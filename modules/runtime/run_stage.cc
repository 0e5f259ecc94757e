// The main of every stage process.
#include <malloc.h>
#include <poll.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <climits>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "core/errors.h"
#include "core/project_file.h"
#include "core/version.h"
#include "runtime/run_dir.h"
#include "runtime/stage.h"
#include "runtime/stage_engine.h"
#include "runtime/udp_check.h"

namespace tessera {
namespace {

std::atomic<bool> told_to_stop{false};

void OnSignal(int /*signal*/) { told_to_stop = true; }

struct Arguments {
  std::string settings_path;
  std::vector<std::string> assignments;
  std::string name;
  int id = 0;
  bool is_held = false;
};

// The arguments; an exit status if the process is to end at once.
std::optional<int> ParseArguments(const std::string& description, int argc, char** argv, Arguments* arguments) {
  CLI::App app(description);
  app.set_version_flag("--version", std::string("Tessera ") + kVersion);
  app.add_option("--settings", arguments->settings_path,
                 "YAML file with the settings that differ from config/default.yaml");
  app.add_option("--set", arguments->assignments, "one setting, section.key=value; may be repeated");
  app.add_option("--name", arguments->name, "name of this process on the bus");
  app.add_option("--id", arguments->id, "number of this extractor: it gets its jobs on TILE_<id>")
      ->check(CLI::Range(0, kMaxExtractors - 1));
  app.add_flag(
      "--held", arguments->is_held,
      "begin to work when the standard input ends: who started this process says so when all others are ready");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return std::nullopt;
}

// A program on its own, without config/default.yaml in a folder above, needs a file that holds all settings.
Settings ReadSettings(const Arguments& arguments) {
  const std::optional<std::filesystem::path> defaults = FindProjectFile("config/default.yaml");
  const bool has_file = !arguments.settings_path.empty();
  if (!defaults && !has_file) {
    throw InputError("no folder above this program holds config/default.yaml; give all settings by --settings FILE");
  }
  Settings settings = Settings::LoadDefaults(defaults ? defaults->string() : arguments.settings_path);
  if (has_file && defaults) settings.OverrideFromFile(arguments.settings_path);
  for (const std::string& assignment : arguments.assignments) {
    settings.Override(assignment);
  }
  return settings;
}

// What a step worked with is freed and soon taken again, by the next one. glibc would give it back to the kernel in
// between, and each 4 kB of it would cost a page fault and be cleared again.
void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
}

void CheckCpu() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("bmi2") || !__builtin_cpu_supports("fma")) {
    throw InputError(
        "this CPU lacks AVX2 (x86-64-v3), for which Tessera is compiled; use a machine from 2015 or later");
  }
#endif
}

void CheckReceiveBuffer(const Settings& settings) {
  const auto bus = settings.Get<BusSettings>();
  const int asked = bus.receive_buffer_bytes;
  const int granted = GrantedReceiveBuffer(asked);
  if (bus.main_url.starts_with("udpm:") && granted < asked) {
    spdlog::warn(
        "the kernel grants a receive buffer of {} bytes where {} are asked for; bursts will have to be sent "
        "again. Raise it: sudo sysctl -w net.core.rmem_max={}",
        granted, asked, asked);
  }
}

std::string HostName() {
  char name[HOST_NAME_MAX + 1] = {};
  gethostname(name, sizeof(name) - 1);
  return name;
}

StageEngine::Setup MakeSetup(const Arguments& arguments) {
  StageEngine::Setup setup;
  setup.settings = ReadSettings(arguments);
  setup.clock = std::make_shared<ComputerClock>();
  const std::string run_dir = setup.settings.Get<BusSettings>().run_dir;
  setup.identity = {.name = arguments.name,
                    .id = arguments.id,
                    .epoch_us = BeginEpoch(run_dir, arguments.name, setup.clock->WallUs()),
                    .host = HostName(),
                    .pid = static_cast<int32_t>(getpid())};
  const int buffer_bytes = setup.settings.Get<BusSettings>().receive_buffer_bytes;
  setup.open_bus = [buffer_bytes](const std::string& url) { return OpenBus(url, buffer_bytes); };
  setup.log = [](bool is_error, const std::string& sentence) {
    spdlog::log(is_error ? spdlog::level::err : spdlog::level::info, "{}", sentence);
  };
  return setup;
}

// Sleeps until a message waits or something is due, and at most a tenth of a second: signals are looked at then.
// `other_descriptor`: that wakes it, too; -1: none.
void Wait(const StageEngine& engine, int other_descriptor = -1) {
  std::vector<pollfd> descriptors{{other_descriptor, POLLIN, 0}};
  for (const auto& bus : engine.buses()) {
    if (bus->file_descriptor() >= 0) descriptors.push_back({bus->file_descriptor(), POLLIN, 0});
  }
  const int64_t wait_us = std::clamp<int64_t>(engine.NextDueUs() - engine.clock_->NowUs(), 0, 100'000);
  const timespec timeout{.tv_sec = 0, .tv_nsec = wait_us * 1000};
  ppoll(descriptors.data(), descriptors.size(), &timeout, nullptr);
}

void RunFor(StageEngine& engine, int64_t duration_us) {
  const int64_t end_us = engine.clock_->NowUs() + duration_us;
  while (engine.clock_->NowUs() < end_us && !engine.stopped_) {
    if (!engine.Step()) Wait(engine);
  }
}

bool HasInputEnded() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (poll(&input, 1, 0) <= 0) return false;
  std::array<char, 256> ignored;
  return read(STDIN_FILENO, ignored.data(), ignored.size()) <= 0;
}

// Its heartbeats go on meanwhile.
void AwaitRelease(StageEngine& engine) {
  while (!told_to_stop && !engine.stopped_ && !HasInputEnded()) {
    if (!engine.Step()) Wait(engine, STDIN_FILENO);
  }
}

bool CanListenAnywhere(const StageEngine& engine) {
  const auto buses = engine.buses();
  return std::any_of(buses.begin(), buses.end(), [](const auto& bus) { return bus->can_listen(); });
}

void RunUntilStopped(StageEngine& engine) {
  while (!told_to_stop && !engine.stopped_) {
    if (!engine.Step()) Wait(engine);
    if (engine.context().finished() && !CanListenAnywhere(engine)) break;  // writing a log: there are no subscribers
  }
}

// A recorder that is told to stop first receives what is under way, and asks for what is missing, for a limited time.
void CompleteRecording(StageEngine& engine) {
  constexpr int64_t kLongestUs = 2'000'000;
  RunFor(engine, 2 * engine.stream_settings_.heartbeat_us);  // a tail that got lost is known then
  const int64_t end_us = engine.clock_->NowUs() + kLongestUs;
  while (engine.incoming_.next_poll_us() && engine.clock_->NowUs() < end_us && !engine.stopped_) {
    if (!engine.Step()) Wait(engine);
  }
  engine.incoming_.AbandonRaw();
}

// The whole life of the stage. Returns the exit status, after a sentence if the stage failed.
int Live(const std::string& program, const Arguments& arguments,
         const std::function<std::shared_ptr<void>(StageContext&)>& make_stage) {
  CheckCpu();
  StageEngine::Setup setup = MakeSetup(arguments);
  CheckReceiveBuffer(setup.settings);
  StageEngine engine(std::move(setup));
  spdlog::info("{} {}", program, kVersion);
  const int64_t two_heartbeats_us = 2 * engine.stream_settings_.heartbeat_us;
  if (CanListenAnywhere(engine)) RunFor(engine, two_heartbeats_us);  // hear of other processes
  if (arguments.is_held) AwaitRelease(engine);
  std::shared_ptr<void> stage;
  if (!engine.stopped_ && !told_to_stop) {
    stage = make_stage(engine.context());
    engine.BeginToRun();  // at once, for those that wait for it to run
    RunUntilStopped(engine);
    if (engine.incoming_.hears_all()) CompleteRecording(engine);
  }
  const int64_t num_published = engine.figures_.num_published;
  engine.ForgetStage();
  stage.reset();
  if (engine.figures_.num_published > num_published && CanListenAnywhere(engine)) {
    RunFor(engine, two_heartbeats_us);  // last words may have to be repeated
  }
  engine.SendStatus(true);
  if (engine.exit_status_ != 0) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), engine.failure_.c_str());
    return engine.exit_status_;
  }
  for (const auto& bus : engine.buses()) bus->Close();
  return 0;
}

}  // namespace

int RunStageMain(const std::string& stage, const std::string& description, int argc, char** argv,
                 const std::function<std::shared_ptr<void>(StageContext&)>& make_stage) {
  Arguments arguments{.name = stage};
  if (const auto exit_status = ParseArguments(description, argc, argv, &arguments)) {
    return *exit_status;
  }
  spdlog::set_default_logger(spdlog::stderr_logger_st(arguments.name));
  spdlog::set_pattern("%H:%M:%S.%e %n %l: %v");
  KeepFreedMemory();
  std::signal(SIGTERM, OnSignal);
  std::signal(SIGINT, OnSignal);
  std::signal(SIGPIPE, SIG_IGN);
  const std::string program = "tessera-" + stage;
  try {
    return Live(program, arguments, make_stage);
  } catch (const InputError& error) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), error.what());
    return 1;
  }
}

}  // namespace tessera
