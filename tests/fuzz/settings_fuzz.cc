// Settings: a user's file, and `section.key=value` of the command line.
//
// Input: whether it is a file; then the text.
#include <fstream>
#include <iterator>

#include "fuzz/fuzz_target.h"
#include "settings/settings.h"

namespace tessera {
namespace {

constexpr const char* kDefaults = TESSERA_SOURCE_DIR "/config/default.yaml";

std::string Text(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

std::vector<std::string> Seeds() {
  const std::string file(1, '\1'), assignment(1, '\0');
  return {file + Text(kDefaults), file + "tracker:\n  max_lost_s: 2.5\n", file + "camera: {source: 'kitti:/x'}\n",
          assignment + "camera.last_frame=12", assignment + "tracker.live=true"};
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  static const Settings defaults = Settings::LoadDefaults(kDefaults);
  FuzzInput input(text);
  Settings settings = defaults;
  const bool is_file = input.TakeByte() % 2 == 1;
  bool is_accepted = false;
  ExpectSentence([&] {
    if (is_file) {
      folder.Write("settings.yaml", input.TakeRest());
      settings.OverrideFromFile(folder.path("settings.yaml"));
    } else {
      settings.Override(std::string(input.TakeRest()));
    }
    is_accepted = true;
  });
  if (!is_accepted) return;
  // It can be handed to the stages.
  const std::string run = settings.ToYaml();
  if (run == defaults.ToYaml()) return;
  folder.Write("run.yaml", run);
  Expect(Settings::LoadDefaults(folder.path("run.yaml")).ToYaml() == run, "settings do not come back the same");
}

}  // namespace tessera
