// Settings are sections of keys with a default each; `config/default.yaml` lists them all, with unit and reason, and
// sections.h gives each its type and range. A user's file or `--set section.key=value` only overrides: an unknown key,
// a missing one, or a value of another type or out of range is an InputError that names key, value, range and origin.
#pragma once

#include <map>
#include <string>

#include "settings/sections.h"

namespace tessera {

class Settings {
 public:
  // Reads a file that holds every key. Throws InputError.
  static Settings LoadDefaults(const std::string& path);

  // Overrides from another file, which may hold only known keys. Throws InputError.
  void OverrideFromFile(const std::string& path);
  // Overrides from text "section.key=value". Throws InputError.
  void Override(const std::string& assignment);

  // A section's values: settings.Get<TrackerSettings>().max_lost_s
  template <class Section>
  Section Get() const {
    Section section;
    Section::Visit(section, [this](const char* name, auto& member, const auto&...) {
      Read(std::string(Section::kSection) + "." + name, &member);
    });
    return section;
  }

  // All values as YAML text that LoadDefaults reads again.
  std::string ToYaml() const;

 private:
  void Set(const std::string& key, const std::string& text, const std::string& origin);
  void Read(const std::string& key, std::string* member) const;
  void Read(const std::string& key, bool* member) const;
  void Read(const std::string& key, int* member) const;
  void Read(const std::string& key, double* member) const;

  std::map<std::string, std::string> texts_;  // by "section.key"; each one was checked
};

}  // namespace tessera
