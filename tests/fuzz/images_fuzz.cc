// Image files, gray and depth: what the checks for completeness make of any bytes. OpenCV's own decoders are not
// instrumented, but what they do wrong with memory is found all the same.
//
// Input: the file's extension, then its bytes.
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "datasets/image_file.h"
#include "fuzz/fuzz_target.h"

namespace tessera {
namespace {

constexpr std::array<const char*, 5> kExtensions{".png", ".jpg", ".pgm", ".bmp", ".tif"};

}  // namespace

std::vector<std::string> Seeds() {
  cv::Mat gray(8, 12, CV_8U), depth(8, 12, CV_16U);
  cv::randu(gray, 0, 255);
  cv::randu(depth, 0, 60000);
  std::vector<std::string> seeds;
  for (size_t i = 0; i < kExtensions.size(); ++i) {
    for (const cv::Mat& image : {gray, depth}) {
      std::vector<uint8_t> bytes;
      if (image.depth() == CV_16U && (kExtensions[i] == std::string(".jpg") || kExtensions[i] == std::string(".bmp"))) {
        continue;
      }
      cv::imencode(kExtensions[i], image, bytes);
      seeds.push_back(std::string(1, static_cast<char>(i)) + std::string(bytes.begin(), bytes.end()));
    }
  }
  return seeds;
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  FuzzInput input(text);
  const std::string name = std::string("image") + kExtensions[input.TakeByte() % kExtensions.size()];
  folder.Write(name, input.TakeRest());
  ExpectSentence([&] { (void)ReadGrayImage(folder.path(name)); });
  ExpectSentence([&] { (void)ReadDepthImage(folder.path(name)); });
}

}  // namespace tessera
