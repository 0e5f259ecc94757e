#include "settings/settings.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <sstream>
#include <type_traits>
#include <variant>
#include <vector>

#include "core/errors.h"

namespace tessera {
namespace {

enum class Kind { kBool, kWhole, kReal, kText };

// What a value must be.
struct Rule {
  Kind kind = Kind::kText;
  std::variant<std::monostate, Range, OneOf, Like> limits;
};

template <class Number>
std::optional<Number> Parse(const std::string& text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

bool IsIn(const Rule& rule, double number) {
  const auto* range = std::get_if<Range>(&rule.limits);
  return range == nullptr || (number >= range->lowest && number <= range->highest);
}

bool Fits(const Rule& rule, const std::string& text) {
  switch (rule.kind) {
    case Kind::kBool:
      return text == "true" || text == "false";
    case Kind::kWhole: {
      const auto number = Parse<int>(text);
      return number && IsIn(rule, *number);
    }
    case Kind::kReal: {
      const auto number = Parse<double>(text);
      return number && IsIn(rule, *number);
    }
    case Kind::kText:
      break;
  }
  if (const auto* one_of = std::get_if<OneOf>(&rule.limits)) {
    return std::find(one_of->texts.begin(), one_of->texts.end(), text) != one_of->texts.end();
  }
  const auto* like = std::get_if<Like>(&rule.limits);
  return like == nullptr || like->matches(text);
}

std::string Words(const Range& range) {
  std::ostringstream words;
  words.precision(10);
  words << " from " << range.lowest << " to " << range.highest;
  if (*range.unit != '\0') words << " " << range.unit;
  return words.str();
}

// What must be written, to follow "must be".
std::string Words(const Rule& rule) {
  if (rule.kind == Kind::kBool) return "true or false";
  if (const auto* range = std::get_if<Range>(&rule.limits)) {
    return (rule.kind == Kind::kWhole ? "a whole number" : "a number") + Words(*range);
  }
  if (const auto* like = std::get_if<Like>(&rule.limits)) return like->words;
  std::string words;
  if (const auto* one_of = std::get_if<OneOf>(&rule.limits)) {
    for (const std::string& text : one_of->texts) words += (words.empty() ? "" : " or ") + text;
  }
  return words;
}

template <class Section>
void AddRules(std::map<std::string, Rule>& rules) {
  Section section;
  Section::Visit(section, [&](const char* name, auto& member, const auto&... limits) {
    using Member = std::decay_t<decltype(member)>;
    Rule rule;
    if constexpr (std::is_same_v<Member, bool>) rule.kind = Kind::kBool;
    if constexpr (std::is_same_v<Member, int>) rule.kind = Kind::kWhole;
    if constexpr (std::is_same_v<Member, double>) rule.kind = Kind::kReal;
    ((rule.limits = limits), ...);
    rules[std::string(Section::kSection) + "." + name] = rule;
  });
}

template <class... Sections>
std::map<std::string, Rule> RulesOf(const std::tuple<Sections...>*) {
  std::map<std::string, Rule> rules;
  (AddRules<Sections>(rules), ...);
  return rules;
}

// By "section.key".
const std::map<std::string, Rule>& Rules() {
  static const std::map<std::string, Rule> rules = RulesOf(static_cast<const AllSections*>(nullptr));
  return rules;
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

constexpr double kMaxSkew = 1e-6;

// nullopt: not 12 numbers, or not a rotation in front of the translation.
std::optional<Rigid3> ParseRigid(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream words(text);
  std::vector<double> numbers;
  for (std::string word; words >> word;) {
    const auto number = Parse<double>(word);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  if (numbers.size() != 12) return std::nullopt;
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(numbers.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const bool is_rotation =
      (rotation * rotation.transpose()).isIdentity(kMaxSkew) && rotation.determinant() > 0.0 && matrix.allFinite();
  if (!is_rotation) return std::nullopt;
  return Rigid3::FromMatrix(rotation, matrix.col(3));
}

}  // namespace

bool IsRigidTransform(const std::string& text) { return text.empty() || ParseRigid(text); }

Rigid3 BodySettings::BaseFromCamera() const { return ParseRigid(base_from_camera).value_or(Rigid3::Identity()); }

bool IsChannelPrefix(const std::string& text) {
  return text.size() <= 32 && std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return (std::isalnum(c) != 0 && c < 128) || c == '_' || c == '-' || c == '/';
         });
}

Settings Settings::LoadDefaults(const std::string& path) {
  Settings settings;
  settings.OverrideFromFile(path);
  for (const auto& [key, rule] : Rules()) {
    if (!settings.texts_.contains(key)) {
      throw InputError("settings file " + path + " lacks the key `" + key + "`: write all keys of config/default.yaml");
    }
  }
  return settings;
}

void Settings::OverrideFromFile(const std::string& path) {
  ForEachValue(path, [&](const std::string& key, const std::string& text) { Set(key, text, "settings file " + path); });
}

void Settings::Override(const std::string& assignment) {
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    throw InputError("--set " + assignment + ": write section.key=value");
  }
  Set(assignment.substr(0, equals), assignment.substr(equals + 1), "--set " + assignment);
}

void Settings::Set(const std::string& key, const std::string& text, const std::string& origin) {
  const auto rule = Rules().find(key);
  if (rule == Rules().end()) {
    throw InputError(origin + ": unknown key `" + key + "`; config/default.yaml lists all keys");
  }
  if (!Fits(rule->second, text)) {
    throw InputError(origin + ": `" + key + "` must be " + Words(rule->second) + ", not `" + text + "`");
  }
  texts_[key] = text;
}

void Settings::Read(const std::string& key, std::string* member) const { *member = texts_.at(key); }
void Settings::Read(const std::string& key, bool* member) const { *member = texts_.at(key) == "true"; }
void Settings::Read(const std::string& key, int* member) const { *member = Parse<int>(texts_.at(key)).value(); }
void Settings::Read(const std::string& key, double* member) const { *member = Parse<double>(texts_.at(key)).value(); }

std::string Settings::ToYaml() const {
  YAML::Emitter out;
  out << YAML::BeginMap;
  std::string open_section;
  for (const auto& [key, text] : texts_) {
    const std::string section = key.substr(0, key.find('.'));
    if (section != open_section) {
      if (!open_section.empty()) out << YAML::EndMap;
      out << YAML::Key << section << YAML::Value << YAML::BeginMap;
      open_section = section;
    }
    out << YAML::Key << key.substr(section.size() + 1) << YAML::Value;
    if (Rules().at(key).kind == Kind::kText) out << YAML::DoubleQuoted;
    out << text;
  }
  if (!open_section.empty()) out << YAML::EndMap;
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace tessera
