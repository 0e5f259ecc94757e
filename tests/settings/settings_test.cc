#include "settings/settings.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/errors.h"

namespace tessera {
namespace {

class SettingsTest : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& text) {
    const auto path = std::filesystem::path(testing::TempDir()) / name;
    std::ofstream(path) << text;
    return path.string();
  }
  Settings Example() {
    return Settings::LoadDefaults(
        Write("defaults.yaml", "camera:\n  source: \"\"\n  window: 6\n  factor: 1.5\n  on: true\n"));
  }
};

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

TEST_F(SettingsTest, GivesTypedValues) {
  const Settings settings = Example();
  EXPECT_EQ(settings.Get<std::string>("camera.source"), "");
  EXPECT_EQ(settings.Get<int>("camera.window"), 6);
  EXPECT_EQ(settings.Get<double>("camera.factor"), 1.5);
  EXPECT_EQ(settings.Get<double>("camera.window"), 6.0);
  EXPECT_TRUE(settings.Get<bool>("camera.on"));
}

TEST_F(SettingsTest, OverridesKeepTheType) {
  Settings settings = Example();
  settings.Override("camera.window=8");
  settings.Override("camera.source=kitti:/a=b");
  settings.Override("camera.factor=2");
  EXPECT_EQ(settings.Get<int>("camera.window"), 8);
  EXPECT_EQ(settings.Get<std::string>("camera.source"), "kitti:/a=b");
  EXPECT_NE(ErrorOf([&] { settings.Override("camera.window=many"); }).find("camera.window"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { settings.Override("camera.window=1.5"); }).find("whole number"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { settings.Override("camera.on=1"); }).find("true or false"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { settings.Override("camera.window"); }).find("section.key=value"), std::string::npos);
}

TEST_F(SettingsTest, UnknownAndMissingKeysFailWithFileAndKey) {
  Settings settings = Example();
  EXPECT_NE(ErrorOf([&] { settings.Override("camera.widow=1"); }).find("camera.widow"), std::string::npos);
  const std::string path = Write("user.yaml", "camera:\n  widow: 1\n");
  const std::string sentence = ErrorOf([&] { settings.OverrideFromFile(path); });
  EXPECT_NE(sentence.find(path), std::string::npos);
  EXPECT_NE(sentence.find("camera.widow"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { (void)settings.Get<int>("camera.nothing"); }), "");
  EXPECT_NE(ErrorOf([] { Settings::LoadDefaults("/no/such.yaml"); }).find("/no/such.yaml"), std::string::npos);
  EXPECT_NE(ErrorOf([&] { Settings::LoadDefaults(Write("broken.yaml", "a: [1\n")); }), "");
  EXPECT_NE(ErrorOf([&] { Settings::LoadDefaults(Write("flat.yaml", "a: 1\n")); }), "");
}

TEST_F(SettingsTest, YamlReadsBackTheSame) {
  Settings settings = Example();
  settings.Override("camera.source=a \"quoted\": # text");
  const Settings again = Settings::LoadDefaults(Write("again.yaml", settings.ToYaml()));
  EXPECT_EQ(again.ToYaml(), settings.ToYaml());
  EXPECT_EQ(again.Get<std::string>("camera.source"), "a \"quoted\": # text");
}

TEST(ShippedSettings, DefaultsLoad) {
  const Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  EXPECT_EQ(settings.Get<int>("features.num_features"), 2000);
}

}  // namespace
}  // namespace tessera
