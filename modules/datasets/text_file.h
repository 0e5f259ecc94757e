// Text files of data sets: rows of fields, with the file and line in every complaint.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

// One line that is neither blank nor a comment (#), cut into fields at blanks, tabs and commas.
struct TextRow {
  std::string location;  // "FILE line 17", for messages
  std::vector<std::string> fields;

  // Field `index` as a finite number. Throws InputError if it isn't one or the row is too short.
  double Number(size_t index) const;
  // Field `index` as a whole number. Throws InputError.
  int64_t Integer(size_t index) const;
  // Field `index`, a time in seconds, as microseconds, rounded to the nearest; a time in nanoseconds, whole. Throws
  // InputError also if it is more than kMaxTimeS from 0: differences of times must be numbers too.
  int64_t TimeUs(size_t index) const;
  int64_t TimeNs(size_t index) const;
  static constexpr double kMaxTimeS = 4e9;  // since 1970: until the year 2096

 private:
  [[noreturn]] void RefuseTime(size_t index) const;
};

// The rows of a file. Throws InputError if it can't be read or has no rows.
std::vector<TextRow> ReadRows(const std::string& path);

// Whether the whole text is one finite number, and which.
bool ParseNumber(const std::string& text, double& number);

}  // namespace tessera
