#include "datasets/image_file.h"

#include "support/dataset_folder.h"

namespace tessera {
namespace {

TEST(ImageFile, ReadsWhatWasWritten) {
  const DatasetFolder folder;
  const cv::Mat pattern = DatasetFolder::Pattern(37, 21, 1);
  for (const char* name : {"a.png", "a.pgm", "a.bmp", "a.tif"}) {
    folder.WriteImage(name, pattern);
    EXPECT_EQ(ReadGrayImage(folder.path(name)), ToGray(pattern)) << name;
  }
}

TEST(ImageFile, ReadsColorsOfColorImagesAlone) {
  const DatasetFolder folder;
  cv::Mat image(21, 37, CV_8UC3, cv::Scalar(200, 100, 50));  // blue first
  folder.WriteImage("color.png", image);
  EXPECT_EQ(ReadColorImage(folder.path("color.png")), ColorImage(37, 21, {.red = 50, .green = 100, .blue = 200}));
  folder.WriteImage("gray.png", DatasetFolder::Pattern(37, 21, 1));
  EXPECT_TRUE(ReadColorImage(folder.path("gray.png")).empty());
  image.setTo(cv::Scalar(70, 70, 70));
  folder.WriteImage("colorless.png", image);
  EXPECT_TRUE(ReadColorImage(folder.path("colorless.png")).empty());
  EXPECT_EQ(ReadGrayImage(folder.path("colorless.png")), GrayImage(37, 21, 70));
}

TEST(ImageFile, RefusesEveryTruncatedJpegAndPng) {
  const DatasetFolder folder;
  for (const char* name : {"a.jpg", "a.png"}) {
    folder.WriteImage(name, DatasetFolder::Pattern(64, 48, 2));
    const std::string whole = folder.Read(name);
    ReadGrayImage(folder.path(name));
    for (size_t length = 0; length < whole.size(); length += 1 + length / 20) {
      folder.Write(name, whole.substr(0, length));
      ExpectInputError([&] { ReadGrayImage(folder.path(name)); }, {folder.path(name)});
    }
    folder.Write(name, whole.substr(0, whole.size() - 1));
    ExpectInputError([&] { ReadGrayImage(folder.path(name)); }, {folder.path(name), "truncated", "copy it again"});
  }
}

TEST(ImageFile, AThumbnailsEndIsNotTheImagesEnd) {
  const DatasetFolder folder;
  folder.WriteImage("a.jpg", DatasetFolder::Pattern(64, 48, 3));
  const std::string whole = folder.Read("a.jpg");
  // An application segment that holds the end marker, as an embedded preview does, behind the start of image.
  const std::string segment("\xFF\xE5\x00\x06\x01\xFF\xD9\x02", 8);
  const std::string with_preview = whole.substr(0, 2) + segment + whole.substr(2);
  folder.Write("b.jpg", with_preview);
  EXPECT_EQ(ReadGrayImage(folder.path("b.jpg")), ReadGrayImage(folder.path("a.jpg")));
  folder.Write("b.jpg", with_preview.substr(0, with_preview.size() / 2));
  ExpectInputError([&] { ReadGrayImage(folder.path("b.jpg")); }, {"truncated"});
}

TEST(ImageFile, AcceptsBytesBehindTheEnd) {
  const DatasetFolder folder;
  folder.WriteImage("a.jpg", DatasetFolder::Pattern(64, 48, 4));
  folder.Write("b.jpg", folder.Read("a.jpg") + std::string(100, '\0'));
  EXPECT_EQ(ReadGrayImage(folder.path("b.jpg")), ReadGrayImage(folder.path("a.jpg")));
}

TEST(ImageFile, RefusesWhatIsNoImage) {
  const DatasetFolder folder;
  folder.Write("a.png", "not an image");
  ExpectInputError([&] { ReadGrayImage(folder.path("a.png")); }, {folder.path("a.png"), "can't be decoded"});
  ExpectInputError([&] { ReadGrayImage(folder.path("b.png")); }, {folder.path("b.png"), "can't be read"});
}

TEST(ImageFile, DepthHasOneChannelOf16Bits) {
  const DatasetFolder folder;
  cv::Mat depth(5, 4, CV_16U, cv::Scalar(0));
  depth.at<uint16_t>(2, 3) = 40000;
  folder.WriteImage("depth.png", depth);
  const DepthImage image = ReadDepthImage(folder.path("depth.png"));
  EXPECT_EQ(image.width, 4);
  EXPECT_EQ(image.height, 5);
  EXPECT_EQ(image.row(2)[3], 40000);
  EXPECT_EQ(image.row(0)[0], 0);
  folder.WriteImage("gray.png", DatasetFolder::Pattern(4, 5, 0));
  ExpectInputError([&] { ReadDepthImage(folder.path("gray.png")); }, {"gray.png", "16 bits"});
}

TEST(ImageFile, ListsImagesInOrderOfTheirNames) {
  const DatasetFolder folder;
  for (const char* name : {"2.png", "10.JPG", "notes.txt", "1.jpeg"}) {
    folder.Write(name, "x");
  }
  EXPECT_EQ(ListImages(folder.path()),
            (std::vector<std::string>{folder.path("1.jpeg"), folder.path("10.JPG"), folder.path("2.png")}));
  EXPECT_TRUE(ListImages(folder.path("none")).empty());
  EXPECT_EQ(FindImage(folder.path("2.jpg")), folder.path("2.png"));
  EXPECT_EQ(FindImage(folder.path("3.jpg")), "");
}

}  // namespace
}  // namespace tessera
