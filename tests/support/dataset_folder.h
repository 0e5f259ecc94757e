// A temporary folder in which a test writes a small data set.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/image.h"
#include "support/temporary_folder.h"

namespace tessera {

class DatasetFolder : public TemporaryFolder {
 public:
  // A gray image whose pixels tell where they are and which image it is.
  static cv::Mat Pattern(int width, int height, int seed) {
    cv::Mat image(height, width, CV_8U);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        image.at<uint8_t>(y, x) = static_cast<uint8_t>((7 * x + 3 * y + 31 * seed) % 251);
      }
    }
    return image;
  }
  void WriteImage(const std::string& name, const cv::Mat& image) const {
    std::filesystem::create_directories(std::filesystem::path(path(name)).parent_path());
    ASSERT_TRUE(cv::imwrite(path(name), image));
  }
};

inline GrayImage ToGray(const cv::Mat& mat) {
  GrayImage image(mat.cols, mat.rows);
  for (int y = 0; y < mat.rows; ++y) {
    std::copy_n(mat.ptr<uint8_t>(y), mat.cols, image.row(y));
  }
  return image;
}

// The call throws an InputError whose single sentence holds all of `parts`.
inline void ExpectInputError(const std::function<void()>& call, const std::vector<std::string>& parts) {
  try {
    call();
    ADD_FAILURE() << "no InputError was thrown";
  } catch (const InputError& error) {
    const std::string sentence = error.what();
    EXPECT_EQ(sentence.find('\n'), std::string::npos) << sentence;
    for (const std::string& part : parts) {
      EXPECT_NE(sentence.find(part), std::string::npos) << "`" << part << "` is not in: " << sentence;
    }
  }
}

}  // namespace tessera
