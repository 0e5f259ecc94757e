#include "settings/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/errors.h"

namespace tessera {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kShipped = TESSERA_SOURCE_DIR "/config/default.yaml";

std::string Write(const std::string& name, const std::string& text) {
  const auto path = std::filesystem::path(testing::TempDir()) / name;
  std::ofstream(path) << text;
  return path.string();
}

// The sentence of the InputError that `action` throws; empty if it throws none.
template <class Action>
std::string ErrorOf(Action action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string ErrorOfSet(const std::string& assignment) {
  Settings settings = Settings::LoadDefaults(kShipped);
  return ErrorOf([&] { settings.Override(assignment); });
}

TEST(Settings, TheShippedFileHoldsEveryKeyAndNoOther) {
  const Settings settings = Settings::LoadDefaults(kShipped);
  EXPECT_EQ(settings.Get<FeaturesSettings>().num_features, 2000);
  EXPECT_EQ(settings.Get<CameraSettings>().sensor, "mono");
  EXPECT_EQ(settings.Get<TrackerSettings>().max_lost_s, 1.5);
  EXPECT_TRUE(settings.Get<MapperSettings>().close_loops);
}

TEST(Settings, LaterOverridesAreStronger) {
  Settings settings = Settings::LoadDefaults(kShipped);
  settings.OverrideFromFile(Write("user.yaml", "tracker:\n  max_lost_s: 2\n  live: true\ncamera:\n  source: a\n"));
  settings.Override("camera.source=kitti:/a=b");
  settings.Override("tracker.max_lost_s=3");
  EXPECT_EQ(settings.Get<CameraSettings>().source, "kitti:/a=b");
  EXPECT_EQ(settings.Get<TrackerSettings>().max_lost_s, 3.0) << "a whole number is a number";
  EXPECT_TRUE(settings.Get<TrackerSettings>().live);
}

TEST(Settings, AValueMustBeOfItsType) {
  EXPECT_THAT(ErrorOfSet("tracker.map_delay_frames=many"), HasSubstr("a whole number from 1 to 1000 frames"));
  EXPECT_THAT(ErrorOfSet("tracker.map_delay_frames=1.5"), HasSubstr("not `1.5`"));
  EXPECT_THAT(ErrorOfSet("tracker.map_delay_frames=99999999999999"), HasSubstr("a whole number"));
  EXPECT_THAT(ErrorOfSet("tracker.max_lost_s=soon"), HasSubstr("a number from 0 to 1000000 s"));
  EXPECT_THAT(ErrorOfSet("tracker.max_lost_s=nan"), HasSubstr("not `nan`"));
  EXPECT_THAT(ErrorOfSet("tracker.live=1"), HasSubstr("true or false"));
}

TEST(Settings, AValueMustBeInItsRange) {
  EXPECT_THAT(ErrorOfSet("features.num_features=50001"),
              AllOf(HasSubstr("`features.num_features`"), HasSubstr("1 to 50000 keypoints"), HasSubstr("`50001`")));
  EXPECT_EQ(ErrorOfSet("features.num_features=50000"), "");
  EXPECT_THAT(ErrorOfSet("tracker.map_delay_frames=0"), HasSubstr("map_delay_frames"));
  EXPECT_THAT(ErrorOfSet("camera.sensor=sonar"), HasSubstr("mono or stereo or rgbd"));
  EXPECT_THAT(ErrorOfSet("bus.channel_prefix=a b"), HasSubstr("letters"));
  EXPECT_EQ(ErrorOfSet("bus.channel_prefix=robot_1/"), "");
}

TEST(Settings, APlaceOnTheBodyIsARotationAndATranslation) {
  Settings settings = Settings::LoadDefaults(kShipped);
  EXPECT_LT(settings.Get<BodySettings>().BaseFromCamera().translation.norm(), 1e-15) << "the camera is the body";
  settings.Override("body.base_from_camera=0 0 1 0.3, -1 0 0 0, 0 -1 0 0.12");
  const Rigid3 base_from_camera = settings.Get<BodySettings>().BaseFromCamera();
  EXPECT_LT((base_from_camera * Eigen::Vector3d(0, 0, 2) - Eigen::Vector3d(2.3, 0, 0.12)).norm(), 1e-12);
  for (const char* wrong : {"0 0 1", "0 0 2 0.3 -1 0 0 0 0 -1 0 0.12", "0 0 1 0.3 -1 0 0 0 0 1 0 0.12", "a b"}) {
    EXPECT_THAT(ErrorOfSet(std::string("body.base_from_camera=") + wrong), HasSubstr("[R | t] row by row")) << wrong;
  }
}

TEST(Settings, ASentenceNamesTheFileAndTheKey) {
  Settings settings = Settings::LoadDefaults(kShipped);
  const std::string path = Write("user.yaml", "camera:\n  widow: 1\n");
  EXPECT_THAT(ErrorOf([&] { settings.OverrideFromFile(path); }), AllOf(HasSubstr(path), HasSubstr("camera.widow")));
  const std::string out_of_range = Write("range.yaml", "camera:\n  lockstep_window: 0\n");
  EXPECT_THAT(ErrorOf([&] { settings.OverrideFromFile(out_of_range); }),
              AllOf(HasSubstr(out_of_range), HasSubstr("camera.lockstep_window"), HasSubstr("1 to 1000")));
  EXPECT_THAT(ErrorOfSet("camera.widow=1"), HasSubstr("camera.widow"));
  EXPECT_THAT(ErrorOfSet("camera.source"), HasSubstr("section.key=value"));
}

TEST(Settings, DefaultsMustBeWholeAndWellFormed) {
  const std::string some = Write("some.yaml", "camera:\n  source: \"\"\n");
  EXPECT_THAT(ErrorOf([&] { Settings::LoadDefaults(some); }), AllOf(HasSubstr(some), HasSubstr("lacks the key")));
  EXPECT_THAT(ErrorOf([] { Settings::LoadDefaults("/no/such.yaml"); }), HasSubstr("/no/such.yaml"));
  EXPECT_NE(ErrorOf([] { Settings::LoadDefaults(Write("broken.yaml", "a: [1\n")); }), "");
  EXPECT_NE(ErrorOf([] { Settings::LoadDefaults(Write("flat.yaml", "a: 1\n")); }), "");
}

TEST(Settings, YamlReadsBackTheSame) {
  Settings settings = Settings::LoadDefaults(kShipped);
  settings.Override("camera.source=a \"quoted\": # text");
  settings.Override("camera.pace=0.5");
  const Settings again = Settings::LoadDefaults(Write("again.yaml", settings.ToYaml()));
  EXPECT_EQ(again.ToYaml(), settings.ToYaml());
  EXPECT_EQ(again.Get<CameraSettings>().source, "a \"quoted\": # text");
}

}  // namespace
}  // namespace tessera
