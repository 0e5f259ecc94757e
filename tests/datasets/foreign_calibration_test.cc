#include "datasets/foreign_calibration.h"

#include "datasets/calibration_file.h"
#include "support/dataset_folder.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr const char* kKalibr = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.0034, 0.0007, -0.0020, 0.0002]
  distortion_model: equidistant
  intrinsics: [190.97, 190.96, 254.93, 256.89]
  resolution: [512, 500]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 0.0, 1.0, 0.5]
  - [0.0, -1.0, 0.0, 0.75]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.0001]
  distortion_model: radtan
  intrinsics: [190.44, 190.43, 252.59, 254.91]
  resolution: [512, 500]
  rostopic: /cam1/image_raw
)";

constexpr const char* kRos = R"(image_width: 640
image_height: 480
camera_name: head_camera
camera_matrix:
  rows: 3
  cols: 3
  data: [438.78, 0., 305.59, 0., 437.35, 243.73, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.36, 0.11, 0.0012, 0.0006, 0.]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
)";

class ForeignCalibration : public testing::Test {
 protected:
  CameraRig Load(const std::string& text) {
    folder_.Write("c.yaml", text);
    return LoadCalibrationFile(folder_.path("c.yaml"));
  }
  void ExpectRefused(std::string text, const std::string& old, const std::string& replacement,
                     const std::string& sentence) {
    text.replace(text.find(old), old.size(), replacement);
    ExpectInputError([&] { Load(text); }, {folder_.path("c.yaml"), sentence});
  }
  DatasetFolder folder_;
};

TEST_F(ForeignCalibration, OfAPairByKalibr) {
  const CameraRig rig = Load(kKalibr);
  EXPECT_EQ(rig.left.width_px, 512);
  EXPECT_EQ(rig.left.height_px, 500);
  EXPECT_EQ(rig.left.fx_px, 190.97);
  EXPECT_EQ(rig.left.cy_px, 256.89);
  EXPECT_EQ(rig.left.lens, LensModel::kEquidistant);
  EXPECT_EQ(rig.left.distortion, (std::vector<double>{0.0034, 0.0007, -0.0020, 0.0002}));
  ASSERT_TRUE(rig.right);
  EXPECT_EQ(rig.right->fy_px, 190.43);
  EXPECT_EQ(rig.right->lens, LensModel::kRadialTangential);
  const Eigen::Vector3d point_in_right = rig.right_from_left * Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_LT((point_in_right - Eigen::Vector3d(0.9, 3.5, -1.25)).norm(), 1e-12);
}

TEST_F(ForeignCalibration, OfOneCameraByRos) {
  const CameraRig rig = Load(kRos);
  EXPECT_FALSE(rig.right);
  EXPECT_EQ(rig.left.width_px, 640);
  EXPECT_EQ(rig.left.fx_px, 438.78);
  EXPECT_EQ(rig.left.fy_px, 437.35);
  EXPECT_EQ(rig.left.cx_px, 305.59);
  EXPECT_EQ(rig.left.cy_px, 243.73);
  EXPECT_EQ(rig.left.distortion, (std::vector<double>{-0.36, 0.11, 0.0012, 0.0006, 0.0}));
}

TEST_F(ForeignCalibration, WhatIsNotSupportedGetsASentence) {
  ExpectRefused(kKalibr, "camera_model: pinhole", "camera_model: omni", "`cam0.camera_model` must be pinhole");
  ExpectRefused(kKalibr, "radtan", "fov", "`cam1.distortion_model` is fov, which is not supported");
  ExpectRefused(kKalibr, "[512, 500]", "[512]", "`cam0.resolution` must have 2 numbers, not 1");
  ExpectRefused(kKalibr, "  T_cn_cnm1:", "  T_cam_imu:", "`cam1.T_cn_cnm1` is missing");
  ExpectRefused(kKalibr, "[0.0, 0.0, 1.0, 0.5]", "[0.0, 2.0, 1.0, 0.5]", "must begin with a rotation");
  ExpectRefused(kRos, "image_width: 640", "width: 640", "`image_width` is missing");
  ExpectRefused(kRos, "data: [438.78, 0., ", "data: [438.78, ", "`camera_matrix.data` must have 9 numbers, not 8");
}

}  // namespace
}  // namespace tessera
