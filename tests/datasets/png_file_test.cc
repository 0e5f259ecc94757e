#include "datasets/png_file.h"

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/dataset_folder.h"

namespace tessera {
namespace {

// A slope with noise: an encoder that may choose uses all filters on it.
cv::Mat NoisySlope(int width, int height, int type) {
  cv::Mat image(height, width, type);
  std::mt19937 random(7);
  const size_t row_bytes = image.elemSize() * static_cast<size_t>(width);
  for (int y = 0; y < height; ++y) {
    for (size_t x = 0; x < row_bytes; ++x) {
      const size_t noise = y % 3 == 0 ? random() % 256 : random() % 4;
      image.ptr<uint8_t>(y)[x] = static_cast<uint8_t>(2 * x + 3 * static_cast<size_t>(y) + noise);
    }
  }
  return image;
}

std::string Encode(const cv::Mat& image, const std::vector<int>& options = {}) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes, options);
  return {bytes.begin(), bytes.end()};
}

// A chunk right behind the header, of which no decoder needs a true checksum to find its name.
std::string WithChunk(const std::string& png, const std::string& type, const std::string& data) {
  constexpr size_t kHeaderEnd = 33;
  const std::string length{0, 0, 0, static_cast<char>(data.size())};
  return png.substr(0, kHeaderEnd) + length + type + data + std::string(4, '\0') + png.substr(kHeaderEnd);
}

cv::Mat OpenCv(const std::string& png, int flags) {
  return cv::imdecode(cv::Mat(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data())), flags);
}

template <class Pixel>
void ExpectSame(const std::optional<Image<Pixel>>& image, const cv::Mat& expected) {
  ASSERT_TRUE(image);
  ASSERT_EQ(image->width, expected.cols);
  ASSERT_EQ(image->height, expected.rows);
  for (int y = 0; y < expected.rows; ++y) {
    ASSERT_TRUE(std::equal(image->row(y), image->row(y) + image->width, expected.ptr<Pixel>(y))) << "row " << y;
  }
}

TEST(PngFile, GivesWhatOpenCvGives) {
  for (const int strategy : {cv::IMWRITE_PNG_STRATEGY_DEFAULT, cv::IMWRITE_PNG_STRATEGY_FILTERED,
                             cv::IMWRITE_PNG_STRATEGY_FIXED, cv::IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY}) {
    const std::vector<int> options{cv::IMWRITE_PNG_STRATEGY, strategy, cv::IMWRITE_PNG_COMPRESSION, 6};
    for (const int width : {1, 37, 640}) {
      const std::string gray = Encode(NoisySlope(width, 21, CV_8UC1), options);
      ExpectSame(GrayOfPng(gray), OpenCv(gray, cv::IMREAD_GRAYSCALE));
      const std::string color = Encode(NoisySlope(width, 21, CV_8UC3), options);
      ExpectSame(GrayOfPng(color), OpenCv(color, cv::IMREAD_GRAYSCALE));
      const std::string depth = Encode(NoisySlope(width, 21, CV_16UC1), options);
      ExpectSame(DepthOfPng(depth), OpenCv(depth, cv::IMREAD_UNCHANGED));
    }
  }
}

TEST(PngFile, ColorsAreThoseOfTheFileAndNoneIfAllAreGray) {
  const cv::Mat image = NoisySlope(37, 21, CV_8UC3);
  const std::optional<ColorImage> colors = ColorOfPng(Encode(image));
  ASSERT_TRUE(colors);
  const auto& pixel = image.at<cv::Vec3b>(5, 9);  // blue first
  EXPECT_EQ(colors->row(5)[9], (Rgb{.red = pixel[2], .green = pixel[1], .blue = pixel[0]}));
  const std::optional<ColorImage> none = ColorOfPng(Encode(cv::Mat(21, 37, CV_8UC3, cv::Scalar(70, 70, 70))));
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->empty());
}

TEST(PngFile, LeavesOtherKindsToOpenCv) {
  const std::string gray = Encode(NoisySlope(37, 21, CV_8UC1)), color = Encode(NoisySlope(37, 21, CV_8UC3)),
                    depth = Encode(NoisySlope(37, 21, CV_16UC1));
  EXPECT_FALSE(GrayOfPng(depth));
  EXPECT_FALSE(DepthOfPng(gray));
  EXPECT_FALSE(ColorOfPng(gray));
  EXPECT_FALSE(GrayOfPng(Encode(NoisySlope(37, 21, CV_8UC4))));
  EXPECT_FALSE(ColorOfPng(Encode(NoisySlope(37, 21, CV_16UC3))));
  EXPECT_FALSE(GrayOfPng(Encode(NoisySlope(37, 21, CV_8UC1), {cv::IMWRITE_PNG_BILEVEL, 1})));
  EXPECT_FALSE(GrayOfPng(WithChunk(color, "gAMA", {0, 0, '\xb1', '\x8f'})));
  EXPECT_TRUE(GrayOfPng(WithChunk(color, "tEXt", "of no account")));
}

TEST(PngFile, NothingOfADamagedFile) {
  const std::string whole = Encode(NoisySlope(64, 48, CV_8UC1));
  ASSERT_TRUE(GrayOfPng(whole));
  for (size_t length = 0; length < whole.size() - 12; length += 1 + length / 20) {  // 12: of the empty last chunk
    EXPECT_FALSE(GrayOfPng(whole.substr(0, length))) << length;
  }
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 0x10;  // a pixel
  EXPECT_FALSE(GrayOfPng(flipped));
  std::string huge = whole;
  huge[16] = 0x7f;  // the width's first byte; the header's checksum no longer fits
  EXPECT_FALSE(GrayOfPng(huge));
}

}  // namespace
}  // namespace tessera
