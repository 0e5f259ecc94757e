#include "datasets/frame_source.h"

#include <cmath>
#include <opencv2/videoio.hpp>

#include "support/dataset_folder.h"

namespace tessera {
namespace {

SourceOptions Options(const std::string& source) {
  SourceOptions options;
  options.source = source;
  return options;
}

TEST(OpenSource, UnknownSourcesAreRefused) {
  for (const std::string source : {"", "kitti", "kitti:", "kiti:/x", "/just/a/path", "log:x"}) {
    ExpectInputError([&] { OpenSource(Options(source)); }, {"source `" + source, "kitti:DIR"});
  }
  ExpectInputError([] { ParseSensor("sterio"); }, {"`sterio`", "mono, stereo or rgbd"});
  EXPECT_EQ(ParseSensor("rgbd"), SensorType::kRgbd);
}

class VideoTest : public testing::Test {
 protected:
  VideoTest() { WriteVideo(6); }

  void WriteVideo(int num_frames) {
    cv::VideoWriter writer(folder_.path("v.avi"), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0, cv::Size(64, 48),
                           true);
    for (int i = 0; i < num_frames; ++i) {
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20.0 + 30.0 * i)));
    }
    writer.release();
    source_ = "video:" + folder_.path("v.avi");
  }

  DatasetFolder folder_;
  std::string source_;
};

constexpr const char* kCalibration = "fx_px: 50\nfy_px: 50\ncx_px: 32\ncy_px: 24\n";

TEST_F(VideoTest, YieldsFramesAtTheRateOfTheFile) {
  folder_.Write("v.yaml", kCalibration);
  SourceOptions options = Options(source_);
  options.first_frame = 2;
  options.last_frame = 5;
  const auto source = OpenSource(options);
  EXPECT_EQ(source->num_frames(), 3);
  EXPECT_FALSE(source->is_live());
  EXPECT_EQ(source->calibration().width_px, 64);
  EXPECT_TRUE(source->ground_truth().empty());
  for (int i = 2; i < 5; ++i) {
    const auto frame = source->Next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->id.value, i);
    EXPECT_EQ(frame->utime_us, 40'000 * i);
    EXPECT_NEAR(frame->left.row(24)[32], 20 + 30 * i, 3);
  }
  EXPECT_FALSE(source->Next());
}

TEST_F(VideoTest, OneThatIsCutOffIsReadAsFarAsItGoesAndSaysWhatItLacks) {
  folder_.Write("v.yaml", kCalibration);
  WriteVideo(60);
  folder_.Truncate("v.avi", 4 * std::filesystem::file_size(folder_.path("v.avi")) / 5);
  const auto source = OpenSource(Options(source_));
  EXPECT_TRUE(source->notes().empty());
  int num_read = 0;
  while (source->Next()) ++num_read;
  ASSERT_GT(num_read, 0);
  ASSERT_LT(num_read, 60);
  ASSERT_EQ(source->notes().size(), 1U);
  EXPECT_NE(source->notes()[0].find("after " + std::to_string(num_read) + " of the 60 frames"), std::string::npos)
      << source->notes()[0];
  EXPECT_FALSE(source->Next());
  EXPECT_EQ(source->notes().size(), 1U);
}

TEST_F(VideoTest, BadInputIsRefused) {
  ExpectInputError([&] { OpenSource(Options(source_)); }, {source_, "--camera FILE.yaml", folder_.path("v.yaml")});
  folder_.Write("v.yaml", kCalibration);
  SourceOptions options = Options(source_);
  options.last_frame = 7;
  ExpectInputError([&] { OpenSource(options); }, {source_, "0:7", "0:6"});
  options.last_frame = -1;
  options.sensor = SensorType::kStereo;
  ExpectInputError([&] { OpenSource(options); }, {source_, "--sensor mono"});
  folder_.Write("v.yaml", std::string(kCalibration) + "width_px: 640\nheight_px: 480\n");
  ExpectInputError([&] { OpenSource(Options(source_)); }, {source_, "64x48", "640x480"});
  ExpectInputError([&] { OpenSource(Options("video:/no/such.mp4")); }, {"/no/such.mp4"});
  folder_.Write("w.mp4", "no video");
  folder_.Write("w.yaml", kCalibration);
  ExpectInputError([&] { OpenSource(Options("video:" + folder_.path("w.mp4"))); }, {folder_.path("w.mp4")});
}

TEST(Cameras, BadInputIsRefused) {
  const DatasetFolder folder;
  folder.Write("c.yaml", kCalibration);
  ExpectInputError([&] { OpenSource(Options("camera:0")); }, {"camera:0", "--camera FILE.yaml"});
  SourceOptions options = Options("camera:first");
  options.calibration_path = folder.path("c.yaml");
  ExpectInputError([&] { OpenSource(options); }, {"camera:first", "camera:N"});
  options.source = "camera:98";
  ExpectInputError([&] { OpenSource(options); }, {"/dev/video98"});
}

}  // namespace
}  // namespace tessera
