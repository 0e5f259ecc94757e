#include "datasets/calibration_section.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "core/files.h"
#include "datasets/camera_rig.h"
#include "datasets/text_file.h"

namespace tessera {
namespace {

// False if anything in it is not a number.
bool CollectNumbers(const YAML::Node& list, std::vector<double>& numbers) {
  return std::all_of(list.begin(), list.end(), [&](const YAML::Node& item) {
    if (item.IsSequence()) return CollectNumbers(item, numbers);
    return item.IsScalar() && ParseNumber(item.Scalar(), numbers.emplace_back());
  });
}

}  // namespace

CalibrationSection::CalibrationSection(std::string path, std::string prefix, const YAML::Node& node)
    : path_(std::move(path)), prefix_(std::move(prefix)), node_(node) {
  if (!node_.IsMap()) {
    throw InputError("calibration file " + path_ +
                     " must hold `key: value` lines; config/cameras/example.yaml shows how");
  }
}

CalibrationSection CalibrationSection::Load(const std::string& path) {
  try {
    return {path, "", YAML::Load(ReadFile(path))};
  } catch (const YAML::Exception& error) {
    throw InputError("calibration file " + path + " is not valid YAML: " + error.what());
  }
}

void CalibrationSection::Allow(std::initializer_list<const char*> keys) const {
  for (const auto& entry : node_) {
    const auto key = entry.first.as<std::string>();
    const auto matches = [&](const char* known) { return key == known; };
    if (std::none_of(keys.begin(), keys.end(), matches)) {
      Complain(key, "is not a known key; config/cameras/example.yaml lists all");
    }
  }
}

CalibrationSection CalibrationSection::Child(const std::string& key) const {
  if (!Has(key)) Complain(key, "is missing");
  return {path_, prefix_ + key + ".", node_[key]};
}

double CalibrationSection::Number(const std::string& key) const {
  double number = 0.0;
  if (!Has(key)) Complain(key, "is missing");
  if (!node_[key].IsScalar() || !ParseNumber(node_[key].Scalar(), number)) Complain(key, "must be a number");
  return number;
}

int CalibrationSection::Integer(const std::string& key) const { return WholeNumber(key, Number(key)); }

int CalibrationSection::WholeNumber(const std::string& key, double number) const {
  if (number != std::floor(number) || std::abs(number) > 1e6) Complain(key, "must be whole");
  return static_cast<int>(number);
}

std::string CalibrationSection::Text(const std::string& key) const {
  if (!Has(key)) Complain(key, "is missing");
  if (!node_[key].IsScalar()) Complain(key, "must be a word");
  return node_[key].Scalar();
}

std::vector<double> CalibrationSection::Numbers(const std::string& key, size_t num) const {
  std::vector<double> numbers;
  if (!Has(key)) Complain(key, "is missing");
  if (!node_[key].IsSequence() || !CollectNumbers(node_[key], numbers)) {
    Complain(key, "must be a list of numbers in [ ]");
  }
  if (num > 0 && numbers.size() != num) {
    Complain(key, "must have " + std::to_string(num) + " numbers, not " + std::to_string(numbers.size()));
  }
  return numbers;
}

std::vector<int> CalibrationSection::Integers(const std::string& key, size_t num) const {
  std::vector<int> integers;
  for (const double number : Numbers(key, num)) integers.push_back(WholeNumber(key, number));
  return integers;
}

Rigid3 CalibrationSection::Transform(const std::string& key, size_t num) const {
  const std::vector<double> numbers = Numbers(key);
  if (numbers.size() != num) {
    Complain(key, "must have " + std::to_string(num) + " numbers, [R | t] row by row, not " +
                      std::to_string(numbers.size()));
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(numbers.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  if (!IsRotation(rotation)) Complain(key, "must begin with a rotation in its first three columns");
  return Rigid3::FromMatrix(rotation, matrix.col(3));
}

void CalibrationSection::Complain(const std::string& key, const std::string& problem) const {
  throw InputError("calibration file " + path_ + ": `" + prefix_ + key + "` " + problem);
}

}  // namespace tessera
