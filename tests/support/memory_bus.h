// Several stages on one bus in one process, with a clock that only moves when nothing is left to do: whole-pipeline
// tests that need no network, never sleep, and always run the same way.
//
//   MemoryBus bus(Settings::LoadDefaults(path));
//   auto tracker = bus.Start<TrackerStage>("tracker");
//   StageContext& probe = bus.AddContext("probe");
//   probe.Subscribe(kPose, ...);
//   ASSERT_TRUE(bus.RunUntil([&] { return num_poses == 100; }));
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "runtime/bus.h"
#include "runtime/stage.h"
#include "settings/settings.h"

namespace tessera {

class MemoryBus {
 public:
  // All buses of the settings become one; the rest of the settings holds for every stage.
  explicit MemoryBus(Settings settings);
  ~MemoryBus();
  MemoryBus(const MemoryBus&) = delete;
  MemoryBus& operator=(const MemoryBus&) = delete;

  // A context for the test itself, or for a stage that is made by hand. `assignments`: settings of its own,
  // section.key=value.
  StageContext& AddContext(const std::string& name, int id = 0, const std::vector<std::string>& assignments = {});

  // Starts a stage. What its constructor throws, this throws.
  template <class Stage>
  Stage& Start(const std::string& name, int id = 0, const std::vector<std::string>& assignments = {}) {
    auto stage = std::make_shared<Stage>(AddContext(name, id, assignments));
    Stage& reference = *stage;
    Keep(name, std::move(stage));
    return reference;
  }
  // Ends a stage as SIGKILL would: it says nothing more, under no prefix. It may be started again under the same name.
  void Kill(const std::string& name);

  // Messages for which `lose` returns true are lost on their way (to everybody).
  void LoseMessages(std::function<bool(const std::string& channel)> lose);

  // Handles messages and idle work, and moves the clock when there is none, until `done` holds. False if it doesn't
  // after `timeout_s` seconds of that clock.
  bool RunUntil(const std::function<bool()>& done, double timeout_s = 60.0);
  // The same until no stage has sent or received a value for `quiet_s` seconds of that clock.
  void RunUntilQuiet(double quiet_s = 1.0);

  // The bus itself, for bytes that no stage of the test sends.
  Bus& bus();

  // Exit status that a stage asked for by Fail(), and its sentence; 0 and empty if it did not.
  int exit_status(const std::string& name) const;
  std::string failure(const std::string& name) const;

 private:
  struct Impl;
  void Keep(const std::string& name, std::shared_ptr<void> stage);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
