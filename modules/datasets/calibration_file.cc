#include "datasets/calibration_file.h"

#include "core/errors.h"
#include "datasets/calibration_section.h"
#include "datasets/foreign_calibration.h"

namespace tessera {
namespace {

PinholeCamera ReadPinhole(const CalibrationSection& section) {
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

void ReadRightCamera(const CalibrationSection& section, CameraRig& rig) {
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
    const CalibrationSection right = section.Child("right");
    right.Allow({"fx_px", "fy_px", "cx_px", "cy_px", "distortion", "distortion_model", "right_from_left"});
    rig.right = ReadPinhole(right);
    rig.right->width_px = rig.left.width_px;
    rig.right->height_px = rig.left.height_px;
    rig.right_from_left = right.Transform("right_from_left");
  }
}

CameraRig ReadOwn(const CalibrationSection& section) {
  section.Allow({"width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "distortion", "distortion_model",
                 "depth_unit_m", "baseline_m", "right", "base_from_camera"});
  if (section.Has("base_from_camera")) section.Transform("base_from_camera");  // used by whoever tells poses
  CameraRig rig;
  rig.left = ReadPinhole(section);
  if (section.Has("width_px") || section.Has("height_px")) {
    rig.left.width_px = section.Integer("width_px");
    rig.left.height_px = section.Integer("height_px");
  }
  ReadRightCamera(section, rig);
  rig.depth_unit_m = section.Has("depth_unit_m") ? section.Number("depth_unit_m") : 0.0;
  if (rig.depth_unit_m < 0.0) {
    section.Complain("depth_unit_m", "must be positive");
  }
  return rig;
}

}  // namespace

CameraRig LoadCalibrationFile(const std::string& path) {
  const CalibrationSection file = CalibrationSection::Load(path);
  const std::optional<CameraRig> foreign = ReadForeignCalibration(file);
  const CameraRig rig = foreign ? *foreign : ReadOwn(file);
  const SensorType sensor = rig.right ? SensorType::kStereo : SensorType::kMono;
  ThrowIfFailed<InputError>(rig.Check(sensor), "calibration file " + path + ": ");
  return rig;
}

}  // namespace tessera
