#include "datasets/calibration_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "core/errors.h"
#include "core/files.h"
#include "datasets/text_file.h"

namespace tessera {
namespace {

// A map of the file, which complains with the file's path and the full name of the key.
class Section {
 public:
  Section(std::string path, std::string prefix, const YAML::Node& node, std::initializer_list<const char*> known_keys)
      : path_(std::move(path)), prefix_(std::move(prefix)), node_(node) {
    if (!node_.IsMap()) {
      throw InputError("calibration file " + path_ +
                       " must hold `key: value` lines; config/cameras/example.yaml shows how");
    }
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>();
      const auto matches = [&](const char* known) { return key == known; };
      if (std::none_of(known_keys.begin(), known_keys.end(), matches)) {
        Complain(key, "is not a known key; config/cameras/example.yaml lists all");
      }
    }
  }

  bool Has(const std::string& key) const { return static_cast<bool>(node_[key]); }
  YAML::Node Child(const std::string& key) const { return node_[key]; }

  double Number(const std::string& key) const {
    double number = 0.0;
    if (!Has(key)) {
      Complain(key, "is missing");
    }
    if (!node_[key].IsScalar() || !ParseNumber(node_[key].Scalar(), number)) {
      Complain(key, "must be a number");
    }
    return number;
  }

  int Integer(const std::string& key) const {
    const double number = Number(key);
    if (number != std::floor(number) || std::abs(number) > 1e6) {
      Complain(key, "must be a whole number");
    }
    return static_cast<int>(number);
  }

  std::string Text(const std::string& key) const {
    if (!node_[key].IsScalar()) Complain(key, "must be a word");
    return node_[key].Scalar();
  }

  std::vector<double> Numbers(const std::string& key) const {
    std::vector<double> numbers;
    if (!node_[key].IsSequence()) {
      Complain(key, "must be a list of numbers in [ ]");
    }
    for (const auto& item : node_[key]) {
      double number = 0.0;
      if (!item.IsScalar() || !ParseNumber(item.Scalar(), number)) {
        Complain(key, "must be a list of numbers in [ ]");
      }
      numbers.push_back(number);
    }
    return numbers;
  }

  [[noreturn]] void Complain(const std::string& key, const std::string& problem) const {
    throw InputError("calibration file " + path_ + ": `" + prefix_ + key + "` " + problem);
  }

 private:
  std::string path_;
  std::string prefix_;
  YAML::Node node_;
};

PinholeCamera ReadPinhole(const Section& section) {
  PinholeCamera camera;
  camera.fx_px = section.Number("fx_px");
  camera.fy_px = section.Number("fy_px");
  camera.cx_px = section.Number("cx_px");
  camera.cy_px = section.Number("cy_px");
  if (section.Has("distortion")) {
    camera.distortion = section.Numbers("distortion");
  }
  if (section.Has("distortion_model")) {
    const std::optional<LensModel> lens = ParseLensModel(section.Text("distortion_model"));
    if (!lens) section.Complain("distortion_model", "must be radial-tangential or equidistant");
    camera.lens = *lens;
  }
  return camera;
}

Rigid3 ReadRigid(const Section& section, const std::string& key) {
  if (!section.Has(key)) {
    section.Complain(key, "is missing");
  }
  const std::vector<double> numbers = section.Numbers(key);
  if (numbers.size() != 12) {
    section.Complain(key, "must have 12 numbers, [R | t] row by row, not " + std::to_string(numbers.size()));
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(numbers.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  if (!IsRotation(rotation)) {
    section.Complain(key, "must begin with a rotation in its first three columns");
  }
  return Rigid3::FromMatrix(rotation, matrix.col(3));
}

void ReadRightCamera(const Section& section, const std::string& path, CameraRig& rig) {
  if (section.Has("right") && section.Has("baseline_m")) {
    section.Complain("baseline_m",
                     "and `right` exclude each other: keep `right` for images that are not rectified yet");
  }
  if (section.Has("baseline_m")) {
    const double baseline_m = section.Number("baseline_m");
    if (baseline_m <= 0.0) {
      section.Complain("baseline_m", "must be positive");
    }
    rig = RectifiedPair(rig.left, baseline_m);
  } else if (section.Has("right")) {
    const Section right(path, "right.", section.Child("right"),
                        {"fx_px", "fy_px", "cx_px", "cy_px", "distortion", "distortion_model", "right_from_left"});
    rig.right = ReadPinhole(right);
    rig.right->width_px = rig.left.width_px;
    rig.right->height_px = rig.left.height_px;
    rig.right_from_left = ReadRigid(right, "right_from_left");
  }
}

}  // namespace

CameraRig LoadCalibrationFile(const std::string& path) {
  YAML::Node document;
  try {
    document = YAML::Load(ReadFile(path));
  } catch (const YAML::Exception& error) {
    throw InputError("calibration file " + path + " is not valid YAML: " + error.what());
  }
  const Section section(path, "", document,
                        {"width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "distortion",
                         "distortion_model", "depth_unit_m", "baseline_m", "right", "base_from_camera"});
  if (section.Has("base_from_camera")) ReadRigid(section, "base_from_camera");  // used by whoever tells poses
  CameraRig rig;
  rig.left = ReadPinhole(section);
  if (section.Has("width_px") || section.Has("height_px")) {
    rig.left.width_px = section.Integer("width_px");
    rig.left.height_px = section.Integer("height_px");
  }
  ReadRightCamera(section, path, rig);
  const double depth_unit_m = section.Has("depth_unit_m") ? section.Number("depth_unit_m") : 0.0;
  rig.depth_unit_m = depth_unit_m;
  if (depth_unit_m < 0.0) {
    section.Complain("depth_unit_m", "must be positive");
  }
  const SensorType sensor = rig.right ? SensorType::kStereo : SensorType::kMono;
  ThrowIfFailed<InputError>(rig.Check(sensor), "calibration file " + path + ": ");
  return rig;
}

}  // namespace tessera
