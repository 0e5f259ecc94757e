// A map of a calibration file, which complains with the file's path and the full name of the key.
#pragma once

#include <yaml-cpp/yaml.h>

#include <initializer_list>
#include <string>
#include <vector>

#include "geometry/rigid3.h"

namespace tessera {

// Every reading function throws InputError if the key is missing or its value is of another kind.
class CalibrationSection {
 public:
  // `prefix`: that of its keys in complaints, such as "right."; empty: the file itself. Throws InputError if the node
  // is no map.
  CalibrationSection(std::string path, std::string prefix, const YAML::Node& node);
  // The whole file. Throws InputError if it can't be read or is no such file.
  static CalibrationSection Load(const std::string& path);

  // Throws InputError if there is any other key.
  void Allow(std::initializer_list<const char*> keys) const;

  bool Has(const std::string& key) const { return static_cast<bool>(node_[key]); }
  CalibrationSection Child(const std::string& key) const;
  double Number(const std::string& key) const;
  int Integer(const std::string& key) const;
  std::string Text(const std::string& key) const;
  // As many numbers as asked for; 0: any. Rows of rows count as one list.
  std::vector<double> Numbers(const std::string& key, size_t num = 0) const;
  std::vector<int> Integers(const std::string& key, size_t num) const;
  // [R | t] row by row, t in meters: 12 numbers, or 16 where a fourth row (0 0 0 1) must follow.
  Rigid3 Transform(const std::string& key, size_t num = 12) const;

  [[noreturn]] void Complain(const std::string& key, const std::string& problem) const;

 private:
  int WholeNumber(const std::string& key, double number) const;

  std::string path_;
  std::string prefix_;
  YAML::Node node_;
};

}  // namespace tessera
