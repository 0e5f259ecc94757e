// tessera-settings: writes all settings, with overrides, into one file that every process of a run reads. The launcher
// uses it, so that a wrong key or value is found before anything starts. Exit status 2 and one sentence on bad input.
#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/files.h"
#include "settings/settings.h"

namespace {

struct Arguments {
  std::string defaults;
  std::vector<std::string> files;
  std::vector<std::string> assignments;
  std::string out;
};

void MergeSettings(const Arguments& arguments) {
  auto settings = tessera::Settings::LoadDefaults(arguments.defaults);
  for (const auto& file : arguments.files) settings.OverrideFromFile(file);
  for (const auto& assignment : arguments.assignments) settings.Override(assignment);
  tessera::WriteFile(arguments.out, settings.ToYaml());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Merges the default settings with overrides, later ones on top, into one file.");
  Arguments arguments;
  app.add_option("--defaults", arguments.defaults, "the file that defines all keys")->required();
  app.add_option("--file", arguments.files, "a settings file that overrides some keys; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--set", arguments.assignments, "section.key=value; may be repeated, stronger than any file")
      ->allow_extra_args(false);
  app.add_option("--out", arguments.out, "where to write all settings")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    MergeSettings(arguments);
  } catch (const tessera::InputError& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return 0;
}
