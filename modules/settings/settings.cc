#include "settings/settings.h"

#include <yaml-cpp/yaml.h>

#include <charconv>

#include "core/errors.h"

namespace tessera {
namespace {

// The type of a value, told from its text: an override must not change it.
enum class Kind { kBool, kInteger, kReal, kText };

template <class Number>
bool ParsesAs(const std::string& text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return !text.empty() && error == std::errc() && end == text.data() + text.size();
}

Kind KindOf(const std::string& text) {
  if (text == "true" || text == "false") return Kind::kBool;
  if (ParsesAs<long long>(text)) return Kind::kInteger;
  if (ParsesAs<double>(text)) return Kind::kReal;
  return Kind::kText;
}

std::string NameOf(Kind kind) {
  switch (kind) {
    case Kind::kBool:
      return "true or false";
    case Kind::kInteger:
      return "a whole number";
    case Kind::kReal:
      return "a number";
    case Kind::kText:
      return "text";
  }
  return "";
}

// Whether `text` may stand where the default is `default_text`: a text key takes anything, a real one whole numbers
// too.
bool Fits(const std::string& text, const std::string& default_text) {
  const Kind wanted = KindOf(default_text);
  const Kind given = KindOf(text);
  return wanted == given || wanted == Kind::kText || (wanted == Kind::kReal && given == Kind::kInteger);
}

// Calls visit(section.key, text) for every scalar of the two-level document.
template <class Visit>
void ForEachValue(const std::string& path, Visit visit) {
  YAML::Node document;
  try {
    document = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw InputError("settings file " + path + " can't be read: check the path and its permissions");
  } catch (const YAML::Exception& error) {
    throw InputError("settings file " + path + " is not valid YAML: " + error.what());
  }
  if (!document.IsMap()) {
    throw InputError("settings file " + path + " must hold sections of `key: value` lines");
  }
  for (const auto& section : document) {
    const auto section_name = section.first.as<std::string>();
    if (!section.second.IsMap()) {
      throw InputError("settings file " + path + ": section `" + section_name + "` must hold `key: value` lines");
    }
    for (const auto& entry : section.second) {
      const auto key = section_name + "." + entry.first.as<std::string>();
      if (!entry.second.IsScalar()) {
        throw InputError("settings file " + path + ": `" + key + "` must be a single value");
      }
      visit(key, entry.second.Scalar());
    }
  }
}

}  // namespace

Settings Settings::LoadDefaults(const std::string& path) {
  Settings settings;
  ForEachValue(path, [&](const std::string& key, const std::string& text) { settings.values_[key] = {text, path}; });
  return settings;
}

void Settings::OverrideFromFile(const std::string& path) {
  ForEachValue(path,
               [&](const std::string& key, const std::string& text) { Replace(key, text, "settings file " + path); });
}

void Settings::Override(const std::string& assignment) {
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    throw InputError("--set " + assignment + ": write section.key=value");
  }
  Replace(assignment.substr(0, equals), assignment.substr(equals + 1), "--set " + assignment);
}

void Settings::Replace(const std::string& key, const std::string& text, const std::string& origin) {
  const auto it = values_.find(key);
  if (it == values_.end()) {
    throw InputError(origin + ": unknown key `" + key + "`; config/default.yaml lists all keys");
  }
  if (!Fits(text, it->second.text)) {
    throw InputError(origin + ": `" + key + "` must be " + NameOf(KindOf(it->second.text)) + ", not `" + text + "`");
  }
  it->second = {text, origin};
}

namespace {

template <class T>
T Parse(const std::string& key, const std::string& text, const std::string& origin, Kind kind) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) {
    throw InputError(origin + ": `" + key + "` must be " + NameOf(kind) + " in range, not `" + text + "`");
  }
  return value;
}

}  // namespace

template <>
std::string Settings::Get<std::string>(const std::string& key) const {
  const auto it = values_.find(key);
  if (it == values_.end()) {
    throw InputError("settings lack the key `" + key + "`; config/default.yaml must list it");
  }
  return it->second.text;
}

template <>
bool Settings::Get<bool>(const std::string& key) const {
  const auto text = Get<std::string>(key);
  if (text != "true" && text != "false") {
    throw InputError(values_.at(key).origin + ": `" + key + "` must be true or false, not `" + text + "`");
  }
  return text == "true";
}

template <>
int Settings::Get<int>(const std::string& key) const {
  const auto text = Get<std::string>(key);
  return Parse<int>(key, text, values_.at(key).origin, Kind::kInteger);
}

template <>
double Settings::Get<double>(const std::string& key) const {
  const auto text = Get<std::string>(key);
  return Parse<double>(key, text, values_.at(key).origin, Kind::kReal);
}

std::string Settings::ToYaml() const {
  YAML::Emitter out;
  out << YAML::BeginMap;
  std::string open_section;
  for (const auto& [key, value] : values_) {
    const std::string section = key.substr(0, key.find('.'));
    if (section != open_section) {
      if (!open_section.empty()) out << YAML::EndMap;
      out << YAML::Key << section << YAML::Value << YAML::BeginMap;
      open_section = section;
    }
    out << YAML::Key << key.substr(section.size() + 1) << YAML::Value;
    if (KindOf(value.text) == Kind::kText) out << YAML::DoubleQuoted;
    out << value.text;
  }
  if (!open_section.empty()) out << YAML::EndMap;
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace tessera
