// The real network, on this host only and on ports of this test.
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/errors.h"
#include "runtime/bus.h"
#include "runtime/stage_engine.h"
#include "runtime/udp_check.h"
#include "support/example_values.h"

namespace tessera {
namespace {

std::string Url(int port) { return "udpm://239.255.76.67:" + std::to_string(port) + "?ttl=0"; }

std::unique_ptr<StageEngine> MakeEngine(const std::string& name) {
  StageEngine::Setup setup;
  setup.settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  setup.settings.Override("bus.main_url=" + Url(17667));
  setup.settings.Override("bus.camera_url=" + Url(17668));
  setup.clock = std::make_shared<ComputerClock>();
  setup.identity = {.name = name, .epoch_us = setup.clock->WallUs(), .host = "here", .pid = getpid()};
  setup.open_bus = [](const std::string& url) { return OpenBus(url, 1 << 20); };
  setup.log = [](bool, const std::string&) {};
  return std::make_unique<StageEngine>(std::move(setup));
}

TEST(Udp, FramesArriveWholeAndInOrder) {
  const auto listener = MakeEngine("listener");
  const auto camera = MakeEngine("camera");
  std::vector<CameraFrame> received;
  listener->context().Subscribe(kCamera, [&](const CameraFrame& frame) { received.push_back(frame); });
  const auto frames = camera->context().Advertise(kCamera);
  std::mt19937 generator(1);
  std::vector<CameraFrame> sent;
  for (int i = 0; i < 30; ++i) {
    sent.push_back(DrawValue<CameraFrame>(generator, 1));
    frames.Publish(sent.back());
  }
  // Until all is there: however long this machine takes, what is lost on the way is asked for again.
  while (received.size() < sent.size()) {
    camera->Step();
    listener->Step();
  }
  EXPECT_EQ(received, sent);
}

TEST(Udp, UrlsAreRead) {
  const auto address = ParseUdpUrl("udpm://239.255.76.67:7667?ttl=0");
  ASSERT_TRUE(address);
  EXPECT_EQ(address->group, "239.255.76.67");
  EXPECT_EQ(address->port, 7667);
  for (const char* url : {"udpm://", "udpm://239.255.76.67", "udpm://239.255.76.67:0", "udpm://239.255.76.67:99999",
                          "udpm://192.168.1.1:7667", "udpm://nowhere:7667", "udpm://239.255.76.67:7667x", "memq://"}) {
    EXPECT_FALSE(ParseUdpUrl(url)) << url;
  }
  EXPECT_THROW(OpenBus("udpm://192.168.1.1:7667", 1 << 20), InputError);
  EXPECT_THROW(OpenBus("tcp://1.2.3.4", 1 << 20), InputError);
  EXPECT_THROW(OpenBus("file:///tmp/log", 1 << 20), InputError);
}

TEST(Udp, APortThatIsTakenGivesASentence) {
  const int other = socket(AF_INET, SOCK_DGRAM, 0);  // shares its port with nobody
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(17669);
  ASSERT_EQ(bind(other, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  const Result<> taken = CheckUdp({.group = "239.255.76.67", .port = 17669});
  close(other);
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().sentence.find("port 17669"), std::string::npos);
  EXPECT_NE(taken.error().sentence.find("another program"), std::string::npos);
  EXPECT_TRUE(CheckUdp({.group = "239.255.76.67", .port = 17669}));
}

TEST(Udp, EachExtractorHasABusOfItsOwn) {
  const Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  EXPECT_NE(UrlOf(TileTopic(0), settings), UrlOf(TileTopic(1), settings));
  EXPECT_NE(UrlOf(TileTopic(3), settings).find(":7683?"), std::string::npos);
  EXPECT_THROW(UrlOf(TileTopic(-1), settings), std::invalid_argument);
}

TEST(Udp, EachExtractorMayHaveAGroupOfItsOwn) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("bus.tile_url=udpm://239.255.77.{id}:{port}?ttl=1");
  EXPECT_EQ(UrlOf(TileTopic(3), settings), "udpm://239.255.77.3:7683?ttl=1");
}

TEST(Udp, TheBusOfTheMapIsTheMainOneUnlessItIsSet) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  EXPECT_EQ(UrlOf(kMapDelta, settings), UrlOf(kPose, settings));
  settings.Override("bus.map_url=udpm://239.255.76.70:7671?ttl=1");
  EXPECT_EQ(UrlOf(kMapDelta, settings), "udpm://239.255.76.70:7671?ttl=1");
  EXPECT_NE(UrlOf(kPose, settings), UrlOf(kMapDelta, settings));
}

}  // namespace
}  // namespace tessera
