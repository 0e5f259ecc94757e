#include "runtime/file_bus.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "wire/log_file.h"

namespace tessera {
namespace {

// The events of a log that a bus writes carry the times of the frames, so that it is played at its true pace.
TEST(FileBus, WritesTheSourcesTimes) {
  const std::string path = testing::TempDir() + "tessera_file_bus_log";
  const auto bus = OpenBus("file://" + path + "?mode=w", 0);
  EXPECT_FALSE(bus->can_listen());
  bus->Publish("CALIBRATION", Bytes(3), std::nullopt);
  bus->Publish("CAMERA", Bytes(5), 7'000'000);
  bus->Publish("GROUND_TRUTH", Bytes(4), std::nullopt);
  bus->Publish("CAMERA", Bytes(5), 7'100'000);
  bus->Publish("CAMERA", Bytes(5), 6'000'000);
  bus->Close();
  LogFileReader reader(path);
  LogEvent event;
  std::vector<std::pair<std::string, int64_t>> times;
  while (reader.Next(&event)) times.emplace_back(event.channel, event.time_us);
  EXPECT_EQ(times, (std::vector<std::pair<std::string, int64_t>>{{"CALIBRATION", 7'000'000},
                                                                 {"CAMERA", 7'000'000},
                                                                 {"GROUND_TRUTH", 7'000'000},
                                                                 {"CAMERA", 7'100'000},
                                                                 {"CAMERA", 7'100'000}}));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace tessera
