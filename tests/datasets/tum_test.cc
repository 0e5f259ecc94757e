#include "datasets/frame_source.h"
#include "datasets/published_calibration.h"
#include "datasets/readme_calibration.h"
#include "support/dataset_folder.h"
#include "support/matchers.h"

namespace tessera {
namespace {

class TumTest : public testing::Test {
 protected:
  // Color at 0, 33, 67 and 100 ms; depth with offsets; the third has no depth within 20 ms.
  TumTest() {
    const std::vector<std::string> color = {"1000.000000", "1000.033000", "1000.067000", "1000.100000"};
    const std::vector<std::string> depth = {"1000.004000", "1000.030000", "1000.095000", "1000.118000"};
    std::string rgb_table = "# timestamp filename\n", depth_table = rgb_table;
    for (size_t i = 0; i < 4; ++i) {
      const cv::Mat gray = DatasetFolder::Pattern(640, 480, static_cast<int>(i));
      cv::Mat bgr;
      cv::merge(std::vector<cv::Mat>{gray, gray, gray}, bgr);
      folder_.WriteImage("rgb/" + color[i] + ".png", bgr);
      folder_.WriteImage("depth/" + depth[i] + ".png",
                         cv::Mat(480, 640, CV_16U, cv::Scalar(1000.0 + static_cast<double>(i))));
      rgb_table += color[i] + " rgb/" + color[i] + ".png\n";
      depth_table += depth[i] + " depth/" + depth[i] + ".png\n";
    }
    folder_.Write("rgb.txt", rgb_table);
    folder_.Write("depth.txt", depth_table);
    folder_.Write("groundtruth.txt",
                  "# t tx ty tz qx qy qz qw\n999.990 0 0 0 0 0 0 1\n1000.010 2 4 0 0 0 0 1\n"
                  "1000.033 5 6 7 0.6 0 0 0.8\n1000.5 0 0 0 0 0 0 1\n");
  }
  SourceOptions Options(SensorType sensor = SensorType::kRgbd, const std::string& name = "") {
    SourceOptions options;
    options.source = "tum:" + (name.empty() ? folder_.path() : folder_.path(name));
    options.sensor = sensor;
    return options;
  }
  void ExpectRefused(const std::vector<std::string>& parts, SensorType sensor = SensorType::kRgbd) {
    ExpectInputError([&] { OpenSource(Options(sensor)); }, parts);
  }
  static std::string Joined(const std::vector<std::string>& notes) {
    std::string text;
    for (const std::string& note : notes) text += note + "\n";
    return text;
  }

  DatasetFolder folder_;
};

TEST_F(TumTest, PairsImagesThatAreEachOthersNearest) {
  const auto source = OpenSource(Options());
  ASSERT_EQ(source->num_frames(), 4);
  const int64_t times_us[] = {1'000'000'000, 1'000'033'000, 1'000'067'000, 1'000'100'000};
  const int64_t depth_delays_us[] = {4'000, -3'000, 0, -5'000};
  const uint16_t depths[] = {1000, 1001, 0, 1002};  // of the third image there is none
  for (int i = 0; i < 4; ++i) {
    const auto frame = source->Next();
    EXPECT_EQ(frame->id.value, i);
    EXPECT_EQ(frame->utime_us, times_us[i]);
    EXPECT_EQ(frame->depth_delay_us, depth_delays_us[i]);
    EXPECT_EQ(frame->left, ToGray(DatasetFolder::Pattern(640, 480, i)));
    ASSERT_EQ(frame->depth.width, 640);
    EXPECT_EQ(frame->depth.row(100)[100], depths[i]);
  }
  EXPECT_NE(Joined(source->notes()).find("1 color images without a depth image within 20 ms are tracked"),
            std::string::npos);
  EXPECT_EQ(OpenSource(Options(SensorType::kMono))->num_frames(), 4);
}

TEST_F(TumTest, InterpolatesGroundTruthButNotOverGaps) {
  const auto source = OpenSource(Options());
  const auto& truth = source->ground_truth();
  ASSERT_EQ(truth.size(), 2U);
  EXPECT_LT((truth[0].world_from_camera.translation - Eigen::Vector3d(1.0, 2.0, 0.0)).norm(), 1e-9);
  EXPECT_EQ(truth[1].frame.value, 1);
  EXPECT_NEAR(truth[1].world_from_camera.rotation.x(), 0.6, 1e-12);
  EXPECT_NEAR(truth[1].world_from_camera.rotation.w(), 0.8, 1e-12);
}

TEST_F(TumTest, FallsBackOnTheUsualKinectWithAWarning) {
  const auto source = OpenSource(Options());
  EXPECT_EQ(source->calibration().fx_px, 525.0);
  EXPECT_EQ(source->calibration().cx_px, 319.5);
  EXPECT_EQ(source->calibration().depth_unit_m, 1.0 / 5000.0);
  EXPECT_NE(Joined(source->notes()).find("Warning"), std::string::npos);
}

TEST_F(TumTest, TakesTheCalibrationFromReadmeThenFileThenOption) {
  folder_.Write("README",
                "RGB-D, depth in millimeters (factor 1000; the TUM sets use 5000), pinhole fx=fy=585 cx=320 cy=240.");
  auto source = OpenSource(Options());
  EXPECT_EQ(source->calibration().fy_px, 585.0);
  EXPECT_EQ(source->calibration().depth_unit_m, 0.001);
  EXPECT_NE(Joined(source->notes()).find(folder_.path("README") + ": fx=585 fy=585 cx=320 cy=240"), std::string::npos);
  EXPECT_EQ(Joined(source->notes()).find("Warning"), std::string::npos);

  folder_.Write("calibration.yaml", "fx_px: 500\nfy_px: 500\ncx_px: 320\ncy_px: 240\ndepth_unit_m: 0.002\n");
  source = OpenSource(Options());
  EXPECT_EQ(source->calibration().fx_px, 500.0);
  EXPECT_EQ(source->calibration().depth_unit_m, 0.002);

  folder_.Write("own.yaml", "fx_px: 501\nfy_px: 501\ncx_px: 320\ncy_px: 240\n");
  SourceOptions options = Options();
  options.calibration_path = folder_.path("own.yaml");
  source = OpenSource(options);
  EXPECT_EQ(source->calibration().fx_px, 501.0);
  EXPECT_EQ(source->calibration().depth_unit_m, 0.001);  // the file says nothing of depth, the README does
  options.depth_unit_m = 0.01;
  EXPECT_EQ(OpenSource(options)->calibration().depth_unit_m, 0.01);
}

// A name of the benchmark, as a link to the same files.
TEST_F(TumTest, FoldersOfTheBenchmarkBringTheirPublishedCalibration) {
  std::filesystem::create_directory_symlink(folder_.path(), folder_.path("rgbd_dataset_freiburg3_office"));
  std::filesystem::create_directory_symlink(folder_.path(), folder_.path("rgbd_dataset_freiburg1_desk"));
  auto source = OpenSource(Options(SensorType::kRgbd, "rgbd_dataset_freiburg3_office/"));
  EXPECT_EQ(source->calibration().fx_px, 535.4);
  EXPECT_EQ(source->calibration().fy_px, 539.2);
  EXPECT_EQ(source->calibration().cx_px, 320.1);
  EXPECT_EQ(source->calibration().cy_px, 247.6);
  EXPECT_EQ(source->calibration().depth_unit_m, 1.0 / 5000.0);
  EXPECT_NE(Joined(source->notes()).find("published for freiburg3: fx=535.4"), std::string::npos);
  EXPECT_EQ(Joined(source->notes()).find("Warning"), std::string::npos);
  EXPECT_EQ(source->Next()->left, ToGray(DatasetFolder::Pattern(640, 480, 0))) << "without distortion";

  source = OpenSource(Options(SensorType::kRgbd, "rgbd_dataset_freiburg1_desk"));
  EXPECT_NE(Joined(source->notes()).find("distortion 0.2624 -0.9531 -0.0054 0.0026 1.1633"), std::string::npos);
  EXPECT_NEAR(source->calibration().fx_px / source->calibration().fy_px, 517.3 / 516.5, 1e-12) << "undistorted";
  const auto frame = source->Next();
  EXPECT_NE(frame->left, ToGray(DatasetFolder::Pattern(640, 480, 0)));
  EXPECT_EQ(frame->depth.row(0)[0], 1000) << "it stays whole";
}

TEST_F(TumTest, OwnCalibrationsWinOverThePublishedOne) {
  const std::string name = "rgbd_dataset_freiburg2_xyz";
  std::filesystem::create_directory_symlink(folder_.path(), folder_.path(name));
  folder_.Write("README", "Depth: factor 1000.");
  auto source = OpenSource(Options(SensorType::kRgbd, name));
  EXPECT_NE(Joined(source->notes()).find("published for freiburg2: fx=520.9"), std::string::npos);
  EXPECT_EQ(source->calibration().depth_unit_m, 0.001) << "the README's";
  folder_.Write("README", "fx=585 fy=585 cx=320 cy=240");
  source = OpenSource(Options(SensorType::kRgbd, name));
  EXPECT_EQ(source->calibration().fx_px, 585.0);
  EXPECT_EQ(source->calibration().depth_unit_m, 1.0 / 5000.0);
  folder_.Write("calibration.yaml", "fx_px: 500\nfy_px: 500\ncx_px: 320\ncy_px: 240\n");
  EXPECT_EQ(OpenSource(Options(SensorType::kRgbd, name))->calibration().fx_px, 500.0);
  folder_.Write("own.yaml", "fx_px: 501\nfy_px: 501\ncx_px: 320\ncy_px: 240\n");
  SourceOptions options = Options(SensorType::kRgbd, name);
  options.calibration_path = folder_.path("own.yaml");
  EXPECT_EQ(OpenSource(options)->calibration().fx_px, 501.0);
}

TEST(PublishedCalibration, GoesByTheNameOfTheFolder) {
  const auto published = PublishedTumCalibration("data/rgbd_dataset_freiburg2_desk/");
  ASSERT_TRUE(published);
  EXPECT_EQ(published->name, "freiburg2");
  EXPECT_EQ(published->rig.left.cy_px, 249.7);
  EXPECT_EQ(published->rig.left.distortion, (std::vector<double>{0.2312, -0.7849, -0.0033, -0.0001, 0.9172}));
  EXPECT_THAT(published->rig.Check(SensorType::kRgbd), IsSuccess());
  for (const char* other : {"rgbd_dataset_freiburg4_desk", "freiburg1_desk", "rgbd_dataset_freiburg1",
                            "my_rgbd_dataset_freiburg1_desk", "rgbd_dataset_freiburg1_desk/rgb", ""}) {
    EXPECT_FALSE(PublishedTumCalibration(other)) << other;
  }
}

TEST_F(TumTest, BadFilesAreRefused) {
  ExpectRefused({"--sensor mono or rgbd"}, SensorType::kStereo);
  const std::string good_table = folder_.Read("depth.txt");
  folder_.Write("depth.txt", "1000.0 depth/gone.png\n");
  ExpectRefused({folder_.path("depth.txt") + " line 1", "gone.png"});
  folder_.Write("depth.txt", "2000.0 depth/1000.004000.png\n");
  ExpectRefused({folder_.path(), "within 20 ms"});
  std::filesystem::remove(folder_.path("depth.txt"));
  ExpectRefused({folder_.path("depth.txt")});
  folder_.Write("depth.txt", good_table);
  folder_.WriteImage("depth/1000.004000.png", DatasetFolder::Pattern(640, 480, 0));
  ExpectInputError([&] { OpenSource(Options())->Next(); }, {"depth/1000.004000.png", "16 bits"});
  folder_.WriteImage("depth/1000.004000.png", cv::Mat(48, 64, CV_16U, cv::Scalar(1)));
  ExpectInputError([&] { OpenSource(Options())->Next(); }, {"depth/1000.004000.png", "64x48", "640x480"});
  folder_.Write("groundtruth.txt", "1000 0 0 0 0 0 1\n");
  ExpectRefused({"groundtruth.txt line 1", "7 fields"});
  folder_.Write("rgb.txt", "1000.0\n");
  ExpectRefused({folder_.path("rgb.txt") + " line 1"}, SensorType::kMono);
}

TEST(ReadmeCalibration, FindsChainsAndSpaces) {
  const auto camera = PinholeFromText("Camera: fx = 517.3, fy=516.5; CX: 318.6 cy =255.25 and later fx=1");
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->fx_px, 517.3);
  EXPECT_EQ(camera->fy_px, 516.5);
  EXPECT_EQ(camera->cx_px, 318.6);
  EXPECT_EQ(camera->cy_px, 255.25);
  EXPECT_FALSE(PinholeFromText("fx=1 fy=2 cx=3"));
  EXPECT_FALSE(PinholeFromText("fx=0 fy=2 cx=3 cy=4"));
  EXPECT_FALSE(PinholeFromText(""));
  EXPECT_EQ(DepthUnitFromText("Depth in millimeters."), 0.001);
  EXPECT_EQ(DepthUnitFromText("Depth in millimetres."), 0.001);
  EXPECT_EQ(DepthUnitFromText("scaled by a factor of"), 0.0);
  EXPECT_EQ(DepthUnitFromText("factor: 5000"), 1.0 / 5000.0);
}

TEST(Tum, ReadsTheKitchenWithoutOptions) {
  if (!std::filesystem::exists(TESSERA_DATA "/rgbd/kitchen")) {
    GTEST_SKIP() << "rgbd/kitchen is not in " TESSERA_DATA;
  }
  SourceOptions options;
  options.source = "tum:" TESSERA_DATA "/rgbd/kitchen";
  options.sensor = SensorType::kRgbd;
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 300);
  EXPECT_EQ(source->ground_truth().size(), 300U);
  EXPECT_EQ(source->calibration().fx_px, 585.0);
  EXPECT_EQ(source->calibration().cy_px, 240.0);
  EXPECT_EQ(source->calibration().depth_unit_m, 0.001);
  EXPECT_FALSE(source->Next()->depth.empty());
}

}  // namespace
}  // namespace tessera
