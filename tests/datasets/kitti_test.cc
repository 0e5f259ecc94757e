#include <cstdio>

#include "datasets/frame_source.h"
#include "support/dataset_folder.h"

namespace tessera {
namespace {

constexpr const char* kP0 = "P0: 70 0 20 0 0 71 15 0 0 0 1 0\n";
constexpr const char* kP1 = "P1: 70 0 20 -35 0 71 15 0 0 0 1 0\n";

class KittiTest : public testing::Test {
 protected:
  // A stereo sequence of five frames at sequences/07, with its ground truth in poses/07.txt.
  KittiTest() {
    std::string times, poses;
    for (int i = 0; i < 5; ++i) {
      folder_.WriteImage(Image(0, i), DatasetFolder::Pattern(40, 30, i));
      folder_.WriteImage(Image(1, i), DatasetFolder::Pattern(40, 30, 100 + i));
      times += std::to_string(0.1 * i) + "\n";
      poses += "1 0 0 " + std::to_string(i) + " 0 1 0 0 0 0 1 " + std::to_string(2 * i) + "\n";
    }
    Write("calib.txt", std::string(kP0) + kP1 + "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n");
    Write("times.txt", times);
    folder_.Write("poses/07.txt", poses);
  }

  static std::string Image(int camera, int index) {
    char name[64];
    std::snprintf(name, sizeof name, "sequences/07/image_%d/%06d.png", camera, index);
    return name;
  }
  void Write(const std::string& name, const std::string& text) { folder_.Write("sequences/07/" + name, text); }
  std::string Path(const std::string& name) { return folder_.path("sequences/07/" + name); }
  SourceOptions Options(SensorType sensor = SensorType::kMono) {
    SourceOptions options;
    options.source = "kitti:" + folder_.path("sequences/07");
    options.sensor = sensor;
    return options;
  }
  void ExpectRefused(const std::vector<std::string>& parts, SensorType sensor = SensorType::kMono) {
    ExpectInputError([&] { OpenSource(Options(sensor)); }, parts);
  }

  DatasetFolder folder_;
};

TEST_F(KittiTest, YieldsAllFramesInOrder) {
  const auto source = OpenSource(Options(SensorType::kStereo));
  EXPECT_EQ(source->num_frames(), 5);
  EXPECT_FALSE(source->is_live());
  const CameraCalibration& calibration = source->calibration();
  EXPECT_EQ(calibration.sensor, SensorType::kStereo);
  EXPECT_EQ(calibration.width_px, 40);
  EXPECT_EQ(calibration.height_px, 30);
  EXPECT_EQ(calibration.fx_px, 70.0);
  EXPECT_EQ(calibration.fy_px, 71.0);
  EXPECT_EQ(calibration.cx_px, 20.0);
  EXPECT_EQ(calibration.cy_px, 15.0);
  EXPECT_EQ(calibration.baseline_m, 0.5);
  for (int i = 0; i < 5; ++i) {
    const auto frame = source->Next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->id.value, i);
    EXPECT_EQ(frame->utime_us, 100'000 * i);
    EXPECT_EQ(frame->sensor, SensorType::kStereo);
    EXPECT_EQ(frame->left, ToGray(DatasetFolder::Pattern(40, 30, i)));
    EXPECT_EQ(frame->right, ToGray(DatasetFolder::Pattern(40, 30, 100 + i)));
  }
  EXPECT_FALSE(source->Next());
  EXPECT_FALSE(source->Next());
}

TEST_F(KittiTest, MonoTakesTheLeftCamera) {
  const auto source = OpenSource(Options());
  const auto frame = source->Next();
  EXPECT_EQ(source->calibration().baseline_m, 0.0);
  EXPECT_EQ(frame->left, ToGray(DatasetFolder::Pattern(40, 30, 0)));
  EXPECT_TRUE(frame->right.empty());
}

TEST_F(KittiTest, ARangeKeepsTheNumbersOfTheSource) {
  SourceOptions options = Options();
  options.first_frame = 2;
  options.last_frame = 4;
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 2);
  ASSERT_EQ(source->ground_truth().size(), 2U);
  EXPECT_EQ(source->ground_truth().front().frame.value, 2);
  const auto frame = source->Next();
  EXPECT_EQ(frame->id.value, 2);
  EXPECT_EQ(frame->utime_us, 200'000);
  EXPECT_EQ(frame->left, ToGray(DatasetFolder::Pattern(40, 30, 2)));
  EXPECT_EQ(source->Next()->id.value, 3);
  EXPECT_FALSE(source->Next());
}

TEST_F(KittiTest, RangesOutsideAreRefused) {
  for (const auto& [first, last] : {std::pair{0, 6}, {5, -1}, {3, 3}, {-1, 2}, {4, 2}}) {
    SourceOptions options = Options();
    options.first_frame = first;
    options.last_frame = last;
    ExpectInputError([&] { OpenSource(options); }, {"frames " + std::to_string(first) + ":", "0:5", options.source});
  }
}

TEST_F(KittiTest, GroundTruthIsFoundAboveOrInside) {
  const auto above = OpenSource(Options())->ground_truth();
  ASSERT_EQ(above.size(), 5U);
  EXPECT_EQ(above[3].frame.value, 3);
  EXPECT_EQ(above[3].utime_us, 300'000);
  EXPECT_EQ(above[3].world_from_camera.translation, Eigen::Vector3d(3.0, 0.0, 6.0));
  Write("poses.txt", "1 0 0 9 0 1 0 8 0 0 1 7\n");
  const auto source = OpenSource(Options());
  ASSERT_EQ(source->ground_truth().size(), 1U);
  EXPECT_EQ(source->ground_truth()[0].world_from_camera.translation, Eigen::Vector3d(9.0, 8.0, 7.0));
  EXPECT_FALSE(source->notes().empty());  // says that it is short
}

TEST_F(KittiTest, CalibrationMayComeInOtherForms) {
  for (const std::string text : {"P0 70 0 20 0 0 71 15 0 0 0 1 0\nP1 70 0 20 -35 0 71 15 0 0 0 1 0\n",
                                 "70 0 20 0 0 71 15 0 0 0 1 0\n70 0 20 -35 0 71 15 0 0 0 1 0\n",
                                 "date: 09-Jan-2012\nP_rect_00: 70 0 20 0 0 71 15 0 0 0 1 0\r\n"
                                 "P_rect_01: 70 0 20 -35 0 71 15 0 0 0 1 0\r\n"}) {
    Write("calib.txt", text);
    const CameraCalibration calibration = OpenSource(Options(SensorType::kStereo))->calibration();
    EXPECT_EQ(calibration.fy_px, 71.0) << text;
    EXPECT_EQ(calibration.baseline_m, 0.5) << text;
  }
}

TEST_F(KittiTest, AnOwnCalibrationReplacesThatOfTheSequence) {
  folder_.Write("c.yaml", "fx_px: 33\nfy_px: 34\ncx_px: 19\ncy_px: 14\n");
  SourceOptions options = Options();
  options.calibration_path = folder_.path("c.yaml");
  EXPECT_EQ(OpenSource(options)->calibration().fx_px, 33.0);
  options.sensor = SensorType::kStereo;
  ExpectInputError([&] { OpenSource(options); }, {"stereo", "right camera"});
}

TEST_F(KittiTest, BadCalibrationIsRefused) {
  Write("calib.txt", "P0: 70 0 20 0 0 71 15 0 0 0 1\n");
  ExpectRefused({Path("calib.txt"), "line 1", "11 numbers"});
  Write("calib.txt", "P0: 70 0 twenty 0 0 71 15 0 0 0 1 0\n");
  ExpectRefused({Path("calib.txt"), "line 1", "`twenty`"});
  Write("calib.txt", "P0: 70 0 nan 0 0 71 15 0 0 0 1 0\n");
  ExpectRefused({Path("calib.txt"), "`nan`"});
  Write("calib.txt", "P0: 0 0 20 0 0 71 15 0 0 0 1 0\n");
  ExpectRefused({Path("calib.txt"), "focal lengths"});
  Write("calib.txt", "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  ExpectRefused({Path("calib.txt"), "P0"});
  Write("calib.txt", "");
  ExpectRefused({Path("calib.txt"), "no rows"});
  Write("calib.txt", kP0);
  ExpectRefused({Path("calib.txt"), "P1", "--sensor mono"}, SensorType::kStereo);
  Write("calib.txt", std::string(kP0) + "P1: 70 0 20 35 0 71 15 0 0 0 1 0\n");
  ExpectRefused({Path("calib.txt"), "P1"}, SensorType::kStereo);
  std::filesystem::remove(Path("calib.txt"));
  ExpectRefused({Path("calib.txt"), "can't be read"});
}

TEST_F(KittiTest, BadTimesAreRefused) {
  Write("times.txt", "0\n0.1\n0.2\n0.3\n");
  ExpectRefused({Path("times.txt"), "4 times for 5 images", "too short"});
  Write("times.txt", "0\n0.1\n0.1\n0.3\n0.4\n");
  ExpectRefused({Path("times.txt"), "frame 2", "not after"});
  Write("times.txt", "0\n0.1\nx\n0.3\n0.4\n");
  ExpectRefused({Path("times.txt"), "line 3", "`x`"});
  std::filesystem::remove(Path("times.txt"));
  ExpectRefused({Path("times.txt")});
}

TEST_F(KittiTest, BadPosesAreRefused) {
  folder_.Write("poses/07.txt", "1 0 0 0 0 1 0 0 0 0 1\n");
  ExpectRefused({"07.txt line 1", "11 fields"});
  folder_.Write("poses/07.txt", "1 0 0 0 0 5 0 0 0 0 1 0\n");
  ExpectRefused({"07.txt line 1", "rotation"});
}

TEST_F(KittiTest, BadFoldersAreRefused) {
  SourceOptions options;
  options.source = "kitti:/no/such/folder";
  ExpectInputError([&] { OpenSource(options); }, {"/no/such/folder", "check the path"});
  std::filesystem::create_directory(folder_.path("empty"));
  options.source = "kitti:" + folder_.path("empty");
  ExpectInputError([&] { OpenSource(options); }, {folder_.path("empty"), "is empty"});
  std::filesystem::remove_all(Path("image_1"));
  ExpectRefused({Path("").substr(0, Path("").size() - 1), "image_1", "--sensor mono"}, SensorType::kStereo);
  ExpectRefused({"no depth"}, SensorType::kRgbd);
  std::filesystem::remove_all(Path("image_0"));
  ExpectRefused({"neither images in image_0/ nor image_0.mp4"});
}

TEST_F(KittiTest, BadImagesAreRefusedWhenTheirTurnComes) {
  folder_.WriteImage(Image(0, 2), DatasetFolder::Pattern(41, 30, 2));
  folder_.Truncate(Image(1, 1), 200);
  auto source = OpenSource(Options());
  source->Next();
  source->Next();
  ExpectInputError([&] { source->Next(); }, {folder_.path(Image(0, 2)), "41x30", "40x30"});
  source = OpenSource(Options(SensorType::kStereo));
  source->Next();
  ExpectInputError([&] { source->Next(); }, {folder_.path(Image(1, 1)), "truncated"});
  folder_.Truncate(Image(0, 0), 200);
  ExpectRefused({folder_.path(Image(0, 0)), "truncated"});
}

TEST_F(KittiTest, MissingImagesAreNoticed) {
  std::filesystem::remove(folder_.path(Image(1, 4)));
  ExpectRefused({"5 images in image_0", "4 in image_1"}, SensorType::kStereo);
  std::filesystem::remove(folder_.path(Image(0, 2)));
  ExpectRefused({folder_.path(Image(0, 3)), "missing"});
}

TEST(Kitti, ReadsVideosInPlaceOfFolders) {
  if (!std::filesystem::exists(TESSERA_DATA "/torcs/g-track-3")) {
    GTEST_SKIP() << "torcs/g-track-3 is not in " TESSERA_DATA;
  }
  SourceOptions options;
  options.source = "kitti:" TESSERA_DATA "/torcs/g-track-3";
  options.first_frame = 3;
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 2840);
  EXPECT_EQ(source->ground_truth().size(), 2840U);
  const auto frame = source->Next();
  EXPECT_EQ(frame->id.value, 3);
  EXPECT_EQ(frame->utime_us, 300'000);
  options.first_frame = 2;
  const auto longer = OpenSource(options);
  longer->Next();
  EXPECT_EQ(longer->Next()->left, frame->left);
  options.sensor = SensorType::kStereo;
  ExpectInputError([&] { OpenSource(options); }, {"g-track-3", "image_1"});
}

TEST(Kitti, ReadsSequence03) {
  if (!std::filesystem::exists(TESSERA_DATA "/kitti/sequences/03")) {
    GTEST_SKIP() << "kitti/sequences/03 is not in " TESSERA_DATA;
  }
  SourceOptions options;
  options.source = "kitti:" TESSERA_DATA "/kitti/sequences/03";
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 801);
  EXPECT_EQ(source->ground_truth().size(), 801U);
  EXPECT_NEAR(source->calibration().fx_px, 721.5377, 1e-9);
  const auto frame = source->Next();
  EXPECT_EQ(frame->left.width, 1242);
  EXPECT_EQ(frame->left.height, 375);
  EXPECT_EQ(source->Next()->utime_us, 103'700);
}

}  // namespace
}  // namespace tessera
