#include <cmath>

#include "datasets/frame_source.h"
#include "geometry/rigid3.h"
#include "support/dataset_folder.h"

namespace tessera {
namespace {

constexpr int64_t kStartNs = 1'400'000'000'000'000'000;
constexpr int64_t kFrameNs = 50'000'000;

// The body turns about its own z by 0.6 rad/s while it moves.
Rigid3 WorldFromBody(int64_t time_ns) {
  const double t = 1e-9 * static_cast<double>(time_ns - kStartNs);
  return {ExpSO3({0.0, 0.0, 0.6 * t}), {t, -2.0 * t, 0.5}};
}

class EurocTest : public testing::Test {
 protected:
  // Four frames; cam0 lacks none, cam1 lacks the second and has one more; poses at 200 Hz that miss the
  // frames' times.
  EurocTest() {
    body_from_left_ = {ExpSO3({0.3, -0.2, 1.5}), {0.1, 0.2, -0.05}};
    body_from_right_ = body_from_left_ * Rigid3{ExpSO3({0.01, 0.0, 0.005}), {0.11, 0.001, 0.0}};
    WriteCamera("cam0", body_from_left_, {0, 1, 2, 3}, "");
    WriteCamera("cam1", body_from_right_, {0, 2, 3, 4}, "");
    std::string poses = "#timestamp, p x y z, q w x y z\n";
    for (int64_t time_ns = kStartNs - 2'000'000; time_ns < kStartNs + 3 * kFrameNs; time_ns += 5'000'000) {
      const Rigid3 pose = WorldFromBody(time_ns);
      char row[256];
      std::snprintf(row, sizeof row, "%ld,%.12f,%.12f,%.12f,%.12f,%.12f,%.12f,%.12f,0,0,0\n", time_ns,
                    pose.translation.x(), pose.translation.y(), pose.translation.z(), pose.rotation.w(),
                    pose.rotation.x(), pose.rotation.y(), pose.rotation.z());
      poses += row;
    }
    folder_.Write("mav0/state_groundtruth_estimate0/data.csv", poses);
  }

  void WriteCamera(const std::string& camera, const Rigid3& body_from_sensor, const std::vector<int>& frames,
                   const std::string& distortion, int64_t later_ns = 0) {
    const Eigen::Matrix<double, 3, 4> m = body_from_sensor.Matrix();
    std::string transform;
    for (int i = 0; i < 12; ++i) {
      char number[32];
      std::snprintf(number, sizeof number, "%.15f, ", m(i / 4, i % 4));
      transform += number;
    }
    folder_.Write("mav0/" + camera + "/sensor.yaml",
                  "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [" + transform +
                      "0.0, 0.0, 0.0, 1.0]\nresolution: [80, 60]\ncamera_model: pinhole\n"
                      "intrinsics: [60.0, 61.0, 40.0, 30.0] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
                      "distortion_coefficients: [" +
                      (distortion.empty() ? "-0.2, 0.05, 0.0002, 0.0001" : distortion) + "]\n");
    std::string rows = "#timestamp [ns],filename\r\n";
    for (const int frame : frames) {
      const std::string name = std::to_string(kStartNs + frame * kFrameNs + later_ns);
      rows += name + "," + name + ".png\r\n";
      folder_.WriteImage("mav0/" + camera + "/data/" + name + ".png", DatasetFolder::Pattern(80, 60, frame));
    }
    folder_.Write("mav0/" + camera + "/data.csv", rows);
  }
  SourceOptions Options(SensorType sensor) {
    SourceOptions options;
    options.source = "euroc:" + folder_.path();
    options.sensor = sensor;
    return options;
  }
  void ExpectRefused(const std::vector<std::string>& parts, SensorType sensor = SensorType::kMono) {
    ExpectInputError([&] { OpenSource(Options(sensor)); }, parts);
  }
  void Replace(const std::string& name, const std::string& from, const std::string& to) {
    std::string text = folder_.Read(name);
    ASSERT_NE(text.find(from), std::string::npos);
    folder_.Write(name, text.replace(text.find(from), from.size(), to));
  }

  DatasetFolder folder_;
  Rigid3 body_from_left_, body_from_right_;
};

TEST_F(EurocTest, CamerasThatArentTriggeredTogetherMakePairsOfImagesThatAreNear) {
  std::filesystem::remove_all(folder_.path("mav0/cam1"));
  WriteCamera("cam1", body_from_right_, {0, 2, 3}, "", 6'400'000);
  const auto source = OpenSource(Options(SensorType::kStereo));
  for (const int frame : {0, 2, 3}) EXPECT_EQ(source->Next()->utime_us, (kStartNs + frame * kFrameNs) / 1000);
  EXPECT_FALSE(source->Next());
  ASSERT_EQ(source->notes().size(), 2U);
  EXPECT_NE(source->notes()[1].find("up to 7 ms apart"), std::string::npos);
}

TEST_F(EurocTest, StereoTakesFramesThatBothCamerasHave) {
  const auto source = OpenSource(Options(SensorType::kStereo));
  EXPECT_EQ(source->num_frames(), 3);
  for (const int frame : {0, 2, 3}) {
    EXPECT_EQ(source->Next()->utime_us, (kStartNs + frame * kFrameNs) / 1000);
  }
  EXPECT_FALSE(source->Next());
  ASSERT_EQ(source->notes().size(), 1U);
  EXPECT_NE(source->notes()[0].find("2 images without a partner"), std::string::npos);
  const double baseline_m = (body_from_left_.Inverse() * body_from_right_).translation.norm();
  EXPECT_NEAR(source->calibration().baseline_m, baseline_m, 1e-9);
  EXPECT_EQ(OpenSource(Options(SensorType::kMono))->num_frames(), 4);
}

TEST_F(EurocTest, GroundTruthIsThatOfTheCameraNotOfTheBody) {
  const auto source = OpenSource(Options(SensorType::kMono));
  ASSERT_EQ(source->ground_truth().size(), 3U);  // the track ends before the fourth frame
  for (const GroundTruthPose& truth : source->ground_truth()) {
    // Mono undistortion doesn't turn the camera: world_from_camera = world_from_body * body_from_camera.
    const Rigid3 expected = WorldFromBody(kStartNs + truth.frame.value * kFrameNs) * body_from_left_;
    EXPECT_LT((truth.world_from_camera.Matrix() - expected.Matrix()).norm(), 1e-5);
  }
}

TEST_F(EurocTest, GroundTruthFollowsTheRectification) {
  const auto source = OpenSource(Options(SensorType::kStereo));
  const GroundTruthPose& truth = source->ground_truth().front();
  const Rigid3 world_from_left = WorldFromBody(kStartNs) * body_from_left_;
  const Rigid3 world_from_right = WorldFromBody(kStartNs) * body_from_right_;
  // The rectified camera stands where the left one does, and the right one stands on its x axis.
  EXPECT_LT((truth.world_from_camera.translation - world_from_left.translation).norm(), 1e-5);
  const Eigen::Vector3d right_in_rectified = truth.world_from_camera.Inverse() * world_from_right.translation;
  EXPECT_LT((right_in_rectified - Eigen::Vector3d(source->calibration().baseline_m, 0.0, 0.0)).norm(), 1e-6);
}

TEST_F(EurocTest, TheFolderMav0ItselfWillDo) {
  SourceOptions options = Options(SensorType::kMono);
  options.source = "euroc:" + folder_.path("mav0");
  EXPECT_EQ(OpenSource(options)->num_frames(), 4);
}

// As in the TUM visual-inertial benchmark.
TEST_F(EurocTest, FisheyeLensesAreUndistorted) {
  for (const char* camera : {"cam0", "cam1"}) {
    Replace(std::string("mav0/") + camera + "/sensor.yaml", "radial-tangential", "equidistant");
  }
  EXPECT_NEAR(OpenSource(Options(SensorType::kMono))->calibration().fx_px, 60.0, 1e-9);
  EXPECT_GT(OpenSource(Options(SensorType::kStereo))->calibration().baseline_m, 0.0);
}

// As in the TUM visual-inertial benchmark, too: no sensor.yaml, Kalibr's calibration, truth by motion capture.
TEST_F(EurocTest, KalibrsCalibrationStandsForTheSensorFiles) {
  std::filesystem::remove(folder_.path("mav0/cam0/sensor.yaml"));
  std::filesystem::create_directories(folder_.path("mav0/mocap0"));
  std::filesystem::rename(folder_.path("mav0/state_groundtruth_estimate0/data.csv"),
                          folder_.path("mav0/mocap0/data.csv"));
  const std::string kalibr =
      "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 61, 40, 30]\n  resolution: [80, 60]\n"
      "  distortion_model: equidistant\n  distortion_coeffs: [0.01, 0, 0, 0]\n";
  folder_.Write("camchain.yaml", kalibr);
  SourceOptions options = Options(SensorType::kMono);
  options.calibration_path = folder_.path("camchain.yaml");
  const auto blind = OpenSource(options);
  EXPECT_TRUE(blind->ground_truth().empty());
  EXPECT_NE(blind->notes().at(0).find("nor T_cam_imu of --camera"), std::string::npos) << blind->notes().at(0);

  folder_.Write("camchain.yaml",
                kalibr + "  T_cam_imu: [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]\n");
  const auto source = OpenSource(options);
  ASSERT_FALSE(source->ground_truth().empty());
  const GroundTruthPose& truth = source->ground_truth().front();
  const Rigid3 body_from_camera = truth.world_from_camera.Inverse() * WorldFromBody(kStartNs);
  EXPECT_LT((body_from_camera.translation - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 1e-5);
}

TEST_F(EurocTest, BadFilesAreRefused) {
  ExpectRefused({"no depth"}, SensorType::kRgbd);
  const std::string sensor = "mav0/cam0/sensor.yaml", table = "mav0/cam0/data.csv";
  const std::string good_sensor = folder_.Read(sensor), good_table = folder_.Read(table);
  Replace(sensor, "radial-tangential", "omnidirectional");
  ExpectRefused({folder_.path(sensor), "omnidirectional"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "intrinsics: [60.0, ", "intrinsics: [");
  ExpectRefused({folder_.path(sensor), "`intrinsics`"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "resolution: [80", "resolution: [.nan");
  ExpectRefused({folder_.path(sensor), "`resolution`"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "resolution: [80", "resolution: [80.5");
  ExpectRefused({folder_.path(sensor), "`resolution`", "whole"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "data: [", "data: [.nan, ");
  Replace(sensor, ", 1.0]", "]");
  ExpectRefused({folder_.path(sensor), "`T_BS.data`"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "data: [", "data: [7.0, ");
  Replace(sensor, ", 1.0]", "]");
  ExpectRefused({folder_.path(sensor), "rotation"});
  folder_.Write(sensor, good_sensor);
  Replace(sensor, "T_BS", "T_BX");
  ExpectRefused({folder_.path(sensor), "`T_BS`"});
  folder_.Write(sensor, "cam: [");
  ExpectRefused({folder_.path(sensor)});
  folder_.Write(sensor, good_sensor);
  folder_.Write(table, "#timestamp [ns],filename\n14x,a.png\n");
  ExpectRefused({folder_.path(table) + " line 2", "`14x`"});
  folder_.Write(table, good_table + "1500000000000000000,gone.png\n");
  ExpectRefused({folder_.path(table) + " line 6", "gone.png", "does not exist"});
  folder_.Write(table, good_table);
  folder_.Write("mav0/state_groundtruth_estimate0/data.csv", "1400000000000000000,1,2,3,4,5,6,7\n");
  ExpectRefused({"data.csv line 1", "quaternion"});
  std::filesystem::remove_all(folder_.path("mav0/cam1"));
  ExpectRefused({"cam1", "--sensor mono"}, SensorType::kStereo);
  std::filesystem::remove_all(folder_.path("mav0/cam0"));
  ExpectRefused({folder_.path(), "mav0/cam0"});
}

TEST_F(EurocTest, ImagesOfAnotherSizeThanTheCalibrationAreRefused) {
  folder_.WriteImage("mav0/cam0/data/" + std::to_string(kStartNs) + ".png", DatasetFolder::Pattern(70, 60, 0));
  ExpectRefused({std::to_string(kStartNs) + ".png", "70x60", "80x60"});
}

TEST(Euroc, ReadsMachineHall01) {
  if (!std::filesystem::exists(TESSERA_DATA "/euroc/MH_01")) {
    GTEST_SKIP() << "euroc/MH_01 is not in " TESSERA_DATA;
  }
  SourceOptions options;
  options.source = "euroc:" TESSERA_DATA "/euroc/MH_01";
  options.sensor = SensorType::kStereo;
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 300);
  EXPECT_EQ(source->ground_truth().size(), 300U);
  EXPECT_NEAR(source->calibration().fx_px, 437.0, 3.0);
  EXPECT_NEAR(source->calibration().baseline_m, 0.1101, 1e-4);
  const auto frame = source->Next();
  EXPECT_EQ(frame->utime_us, 1403636584763555);
  EXPECT_EQ(frame->left.width, 752);
  EXPECT_EQ(frame->right.height, 480);
  options.sensor = SensorType::kMono;
  EXPECT_EQ(OpenSource(options)->num_frames(), 300);
}

}  // namespace
}  // namespace tessera
