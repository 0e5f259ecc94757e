#include "datasets/calibration_file.h"

#include "datasets/calibration_section.h"
#include "support/dataset_folder.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr const char* kPinhole = "fx_px: 400\nfy_px: 401\ncx_px: 320\ncy_px: 240\n";

TEST(CalibrationFile, ShippedFilesLoad) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TESSERA_SOURCE_DIR "/config/cameras")) {
    const CameraRig rig = LoadCalibrationFile(entry.path());
    EXPECT_THAT(rig.Check(SensorType::kMono), IsSuccess()) << entry.path();
    ++count;
  }
  EXPECT_GT(count, 0);
}

TEST(CalibrationFile, ReadsEveryKey) {
  const DatasetFolder folder;
  folder.Write("c.yaml",
               std::string(kPinhole) +
                   "width_px: 640\nheight_px: 480\ndistortion: [0.1, -0.2, 1e-3, 2e-3, 0.05]\ndepth_unit_m: 0.001\n"
                   "right:\n  fx_px: 410\n  fy_px: 411\n  cx_px: 321\n  cy_px: 241\n"
                   "  right_from_left: [1, 0, 0, -0.25, 0, 0, 1, 0.5, 0, -1, 0, 0.75]\n");
  const CameraRig rig = LoadCalibrationFile(folder.path("c.yaml"));
  EXPECT_EQ(rig.left.width_px, 640);
  EXPECT_EQ(rig.left.height_px, 480);
  EXPECT_EQ(rig.left.fx_px, 400.0);
  EXPECT_EQ(rig.left.cy_px, 240.0);
  EXPECT_EQ(rig.left.distortion, (std::vector<double>{0.1, -0.2, 1e-3, 2e-3, 0.05}));
  EXPECT_EQ(rig.depth_unit_m, 0.001);
  ASSERT_TRUE(rig.right);
  EXPECT_EQ(rig.right->fx_px, 410.0);
  EXPECT_EQ(rig.right->width_px, 640);
  const Eigen::Vector3d point_in_right = rig.right_from_left * Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_LT((point_in_right - Eigen::Vector3d(0.75, 3.5, -1.25)).norm(), 1e-12);
}

TEST(CalibrationFile, KnowsFisheyeLenses) {
  const DatasetFolder folder;
  const std::string fisheye = "distortion: [0.1, 0.2, 0.3, 0.4]\ndistortion_model: equidistant\n";
  folder.Write("c.yaml", kPinhole + fisheye);
  EXPECT_EQ(LoadCalibrationFile(folder.path("c.yaml")).left.lens, LensModel::kEquidistant);
  folder.Write("c.yaml", std::string(kPinhole) + "distortion: [0.1, 0.2, 0.3, 0.4]\n");
  EXPECT_EQ(LoadCalibrationFile(folder.path("c.yaml")).left.lens, LensModel::kRadialTangential);
}

TEST(CalibrationFile, BaselineStandsForARectifiedPair) {
  const DatasetFolder folder;
  folder.Write("c.yaml", std::string(kPinhole) + "baseline_m: 0.54\n");
  const CameraRig rig = LoadCalibrationFile(folder.path("c.yaml"));
  EXPECT_THAT(rig.Check(SensorType::kStereo), IsSuccess());
  EXPECT_EQ(rig.right_from_left.translation.x(), -0.54);
  EXPECT_FALSE(rig.Check(SensorType::kRgbd));
}

TEST(CalibrationFile, BadFilesGetASentence) {
  const DatasetFolder folder;
  const std::string path = folder.path("c.yaml");
  const auto load = [&] { LoadCalibrationFile(path); };
  const auto expect = [&](const std::string& text, const std::string& part) {
    folder.Write("c.yaml", text);
    ExpectInputError(load, {path, part});
  };
  ExpectInputError(load, {path, "can't be read"});
  expect("fx_px: [", "YAML");
  expect("just text", "key: value");
  expect(std::string(kPinhole) + "fz_px: 1\n", "`fz_px`");
  expect("fx_px: 400\nfy_px: 401\ncx_px: 320\n", "`cy_px` is missing");
  expect("fx_px: much\nfy_px: 401\ncx_px: 320\ncy_px: 240\n", "`fx_px` must be a number");
  expect("fx_px: -1\nfy_px: 401\ncx_px: 320\ncy_px: 240\n", "focal lengths");
  expect(std::string(kPinhole) + "distortion: [1, 2]\n", "4, 5 or 8");
  expect(std::string(kPinhole) + "distortion: 3\n", "`distortion`");
  expect(std::string(kPinhole) + "distortion_model: omnidirectional\n", "radial-tangential or equidistant");
  expect(std::string(kPinhole) + "distortion_model: equidistant\n", "must have 4 numbers");
  expect(std::string(kPinhole) + "width_px: 640\n", "`height_px` is missing");
  expect(std::string(kPinhole) + "baseline_m: -1\n", "`baseline_m`");
  expect(std::string(kPinhole) + "depth_unit_m: -1\n", "`depth_unit_m`");
  expect(std::string(kPinhole) + "baseline_m: 1\nright: {}\n", "exclude each other");
  expect(std::string(kPinhole) + "right:\n  fx_px: 1\n  fy_px: 1\n  cx_px: 1\n  cy_px: 1\n",
         "`right.right_from_left` is missing");
  expect(std::string(kPinhole) +
             "right:\n  fx_px: 1\n  fy_px: 1\n  cx_px: 1\n  cy_px: 1\n"
             "  right_from_left: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n",
         "must have 12 numbers, [R | t] row by row, not 16");
  expect(std::string(kPinhole) +
             "right:\n  fx_px: 1\n  fy_px: 1\n  cx_px: 1\n  cy_px: 1\n"
             "  right_from_left: [1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0]\n",
         "rotation");
}

}  // namespace
}  // namespace tessera
