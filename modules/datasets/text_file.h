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
};

// The rows of a file. Throws InputError if it can't be read or has no rows.
std::vector<TextRow> ReadRows(const std::string& path);

// Whether the whole text is one finite number, and which.
bool ParseNumber(const std::string& text, double& number);

// Microseconds of a time in seconds, rounded to the nearest.
int64_t MicrosecondsFromSeconds(double seconds);

}  // namespace tessera
