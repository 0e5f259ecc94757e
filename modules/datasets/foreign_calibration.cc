#include "datasets/foreign_calibration.h"

namespace tessera {
namespace {

// `model`: a key of the section that names the lens.
LensModel ReadLens(const CalibrationSection& section, const std::string& model) {
  const std::optional<LensModel> lens = ParseLensModel(section.Text(model));
  if (!lens) section.Complain(model, "is " + section.Text(model) + ", which is not supported");
  return *lens;
}

// As Kalibr and EuRoC have it. `coefficients`: the key of those of the lens.
PinholeCamera ReadPinhole(const CalibrationSection& section, const std::string& coefficients) {
  if (section.Text("camera_model") != "pinhole") {
    section.Complain("camera_model", "must be pinhole (with radial-tangential or equidistant distortion)");
  }
  const std::vector<double> intrinsics = section.Numbers("intrinsics", 4);
  const std::vector<int> size = section.Integers("resolution", 2);
  PinholeCamera camera{size[0], size[1], intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], {}};
  if (section.Text("distortion_model") == "none") return camera;
  camera.lens = ReadLens(section, "distortion_model");
  camera.distortion = section.Numbers(coefficients);
  return camera;
}

CameraRig ReadKalibr(const CalibrationSection& file) {
  CameraRig rig;
  rig.left = ReadPinhole(file.Child("cam0"), "distortion_coeffs");
  if (file.Has("cam1")) {
    rig.right = ReadPinhole(file.Child("cam1"), "distortion_coeffs");
    rig.right_from_left = file.Child("cam1").Transform("T_cn_cnm1", 16);
  }
  if (file.Child("cam0").Has("T_cam_imu")) rig.body_from_left = file.Child("cam0").Transform("T_cam_imu", 16).Inverse();
  return rig;
}

// K = [fx 0 cx; 0 fy cy; 0 0 1]
CameraRig ReadRos(const CalibrationSection& file) {
  const std::vector<double> matrix = file.Child("camera_matrix").Numbers("data", 9);
  CameraRig rig;
  rig.left = {file.Integer("image_width"),
              file.Integer("image_height"),
              matrix[0],
              matrix[4],
              matrix[2],
              matrix[5],
              file.Child("distortion_coefficients").Numbers("data")};
  rig.left.lens = ReadLens(file, "distortion_model");
  return rig;
}

}  // namespace

std::optional<CameraRig> ReadForeignCalibration(const CalibrationSection& file) {
  if (file.Has("cam0")) return ReadKalibr(file);
  if (file.Has("camera_matrix")) return ReadRos(file);
  return std::nullopt;
}

CameraOnBody ReadEurocSensor(const CalibrationSection& file) {
  return {ReadPinhole(file, "distortion_coefficients"), file.Child("T_BS").Transform("data", 16)};
}

}  // namespace tessera
