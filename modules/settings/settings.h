// Settings are sections of keys with a default each; `config/default.yaml` lists them all, with unit and reason.
// A user's file or `--set section.key=value` only overrides: an unknown key, a missing one, or a value of another
// type is an InputError with file and key in its sentence.
#pragma once

#include <map>
#include <string>

namespace tessera {

class Settings {
 public:
  // Reads the file that defines which keys exist.
  static Settings LoadDefaults(const std::string& path);

  // Overrides from another file, which may hold only known keys. Throws InputError.
  void OverrideFromFile(const std::string& path);
  // Overrides from text "section.key=value". Throws InputError.
  void Override(const std::string& assignment);

  // Value of "section.key". Throws InputError if there is no such key or its text is not of the type.
  template <class T>
  T Get(const std::string& key) const;

  // All values as YAML text that LoadDefaults reads again.
  std::string ToYaml() const;

 private:
  struct Value {
    std::string text;
    std::string origin;  // file or argument it came from, for messages
  };
  void Replace(const std::string& key, const std::string& text, const std::string& origin);

  std::map<std::string, Value> values_;  // by "section.key"
};

template <>
bool Settings::Get<bool>(const std::string& key) const;
template <>
int Settings::Get<int>(const std::string& key) const;
template <>
double Settings::Get<double>(const std::string& key) const;
template <>
std::string Settings::Get<std::string>(const std::string& key) const;

}  // namespace tessera
