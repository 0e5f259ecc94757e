#include "datasets/text_file.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include "core/errors.h"
#include "core/files.h"

namespace tessera {
namespace {

std::vector<std::string> Fields(const std::string& line) {
  constexpr const char* kSeparators = " \t,\r";
  std::vector<std::string> fields;
  size_t begin = line.find_first_not_of(kSeparators);
  while (begin != std::string::npos) {
    const size_t end = line.find_first_of(kSeparators, begin);
    fields.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kSeparators, end);
  }
  return fields;
}

}  // namespace

bool ParseNumber(const std::string& text, double& number) {
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(begin, end, number);
  return begin != end && error == std::errc() && stop == end && std::isfinite(number);
}

double TextRow::Number(size_t index) const {
  if (index >= fields.size()) {
    throw InputError(location + " has " + std::to_string(fields.size()) + " fields, but at least " +
                     std::to_string(index + 1) + " are needed: repair the file");
  }
  double number = 0.0;
  if (!ParseNumber(fields[index], number)) {
    throw InputError(location + ": field " + std::to_string(index + 1) + ", `" + fields[index] +
                     "`, is not a number: repair the file");
  }
  return number;
}

int64_t TextRow::Integer(size_t index) const {
  Number(index);  // refuses a row that is too short
  const std::string& text = fields[index];
  int64_t number = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || stop != text.data() + text.size()) {
    throw InputError(location + ": field " + std::to_string(index + 1) + ", `" + text +
                     "`, is not a whole number: repair the file");
  }
  return number;
}

int64_t TextRow::TimeUs(size_t index) const {
  const double seconds = Number(index);
  if (std::abs(seconds) > kMaxTimeS) RefuseTime(index);
  return std::llround(seconds * 1e6);
}

int64_t TextRow::TimeNs(size_t index) const {
  constexpr auto kMaxNs = static_cast<int64_t>(1e9 * kMaxTimeS);
  const int64_t time_ns = Integer(index);
  if (time_ns > kMaxNs || time_ns < -kMaxNs) RefuseTime(index);
  return time_ns;
}

void TextRow::RefuseTime(size_t index) const {
  throw InputError(location + ": field " + std::to_string(index + 1) + ", `" + fields[index] +
                   "`, is no time between 1970 and 2096: repair the file");
}

std::vector<TextRow> ReadRows(const std::string& path) {
  std::istringstream text(ReadFile(path));
  std::vector<TextRow> rows;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    std::vector<std::string> fields = Fields(line);
    if (!fields.empty() && !fields.front().starts_with('#')) {
      rows.push_back({path + " line " + std::to_string(number), std::move(fields)});
    }
  }
  if (rows.empty()) {
    throw InputError("file " + path + " holds no rows: is the data set complete?");
  }
  return rows;
}

}  // namespace tessera
