#include "support/warped_pairs.h"

#include <Eigen/LU>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "support/feature_images.h"

namespace tessera {
namespace {

// Wider than the borders that either extractor leaves empty at the fine levels.
constexpr double kMarginPx = 40.0;

cv::Mat View(const GrayImage& image) {
  return {image.height, image.width, CV_8U, const_cast<uint8_t*>(image.pixels.data())};
}

// Turn and scale about the image's center, then shift and tilt.
Eigen::Matrix3d Motion(const GrayImage& image, double degrees, double scale, double shift_px, double tilt) {
  const double c = scale * std::cos(degrees * M_PI / 180.0);
  const double s = scale * std::sin(degrees * M_PI / 180.0);
  Eigen::Matrix3d center = Eigen::Matrix3d::Identity();
  center(0, 2) = -0.5 * image.width;
  center(1, 2) = -0.5 * image.height;
  Eigen::Matrix3d motion;
  motion << c, -s, shift_px, s, c, -0.7 * shift_px, tilt / image.width, -tilt / image.width, 1.0;
  return center.inverse() * motion * center;
}

WarpedPair Warp(const std::string& name, const GrayImage& image, const Eigen::Matrix3d& second_from_first) {
  WarpedPair pair{.name = name, .first = image, .second = image, .second_from_first = second_from_first};
  cv::Mat matrix(3, 3, CV_64F);
  for (int i = 0; i < 9; ++i) matrix.at<double>(i / 3, i % 3) = second_from_first(i / 3, i % 3);
  cv::warpPerspective(View(image), View(pair.second), matrix, cv::Size(image.width, image.height), cv::INTER_CUBIC,
                      cv::BORDER_REFLECT_101);
  std::mt19937 random(1);
  for (uint8_t& pixel : pair.second.pixels) {
    int noise = 0;  // sum of uniform numbers, sigma 3
    for (int i = 0; i < 3; ++i) noise += static_cast<int>(random() % 7) - 3;
    pixel = cv::saturate_cast<uint8_t>(0.9 * pixel + 12.0 + 0.87 * noise);
  }
  return pair;
}

Eigen::Vector2d TruePlace(const WarpedPair& pair, const Eigen::Vector2d& point) {
  return (pair.second_from_first * point.homogeneous()).hnormalized();
}

bool IsWellInside(const GrayImage& image, const Eigen::Vector2d& point) {
  return point.x() >= kMarginPx && point.y() >= kMarginPx && point.x() < image.width - kMarginPx &&
         point.y() < image.height - kMarginPx;
}

// Index of the descriptor nearest to each one of `queries`.
std::vector<size_t> Nearest(const std::vector<Descriptor>& queries, const std::vector<Descriptor>& candidates) {
  std::vector<size_t> nearest(queries.size(), 0);
  for (size_t i = 0; i < queries.size(); ++i) {
    int best = 257;
    for (size_t k = 0; k < candidates.size(); ++k) {
      const int distance = HammingDistance(queries[i], candidates[k]);
      if (distance < best) {
        best = distance;
        nearest[i] = k;
      }
    }
  }
  return nearest;
}

PointSet FromCv(const std::vector<cv::KeyPoint>& keypoints, const cv::Mat& descriptors) {
  PointSet set;
  for (size_t i = 0; i < keypoints.size(); ++i) {
    set.points.emplace_back(keypoints[i].pt.x, keypoints[i].pt.y);
    std::memcpy(set.descriptors.emplace_back().data(), descriptors.ptr(static_cast<int>(i)), 32);
  }
  return set;
}

}  // namespace

std::vector<WarpedPair> MakeWarpedPairs(const GrayImage& image) {
  return {Warp("shift", image, Motion(image, 0.0, 1.0, 7.4, 0.0)),
          Warp("turn by 8", image, Motion(image, 8.0, 1.0, 3.3, 0.0)),
          Warp("turn by 35", image, Motion(image, 35.0, 1.0, -2.2, 0.0)),
          Warp("scale 1.1", image, Motion(image, 0.0, 1.1, 1.6, 0.0)),
          Warp("scale 0.75", image, Motion(image, 2.0, 0.75, -4.1, 0.0)),
          Warp("perspective", image, Motion(image, -4.0, 1.05, 5.2, 0.15))};
}

PointSet ExtractTessera(const GrayImage& image, const FeatureOptions& options) {
  const FeatureFrame frame = ExtractWhole(MakeFrame(SensorType::kMono, image), options);
  PointSet set{.points = {}, .descriptors = frame.descriptors};
  for (const Keypoint& keypoint : frame.keypoints) set.points.emplace_back(keypoint.x_px, keypoint.y_px);
  return set;
}

PointSet ExtractCvOrb(const GrayImage& image, const FeatureOptions& options) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  cv::ORB::create(options.num_features)->detectAndCompute(View(image), cv::noArray(), keypoints, descriptors);
  return FromCv(keypoints, descriptors);
}

PointSet ExtractCvOrbAtTessera(const GrayImage& image, const FeatureOptions& options) {
  std::vector<cv::KeyPoint> keypoints;
  for (const Keypoint& keypoint : ExtractWhole(MakeFrame(SensorType::kMono, image), options).keypoints) {
    keypoints.emplace_back(keypoint.x_px, keypoint.y_px, 31.0F * std::pow(1.2F, keypoint.level),
                           360.0F / 256.0F * keypoint.angle, keypoint.score, keypoint.level);
  }
  cv::Mat descriptors;
  cv::ORB::create(options.num_features)->compute(View(image), keypoints, descriptors);
  return FromCv(keypoints, descriptors);
}

double Repeatability(const WarpedPair& pair, const PointSet& first, const PointSet& second) {
  int num_visible = 0;
  int num_found = 0;
  for (const Eigen::Vector2d& point : first.points) {
    const Eigen::Vector2d place = TruePlace(pair, point);
    if (!IsWellInside(pair.second, place)) continue;
    ++num_visible;
    for (const Eigen::Vector2d& other : second.points) {
      if ((other - place).squaredNorm() <= 4.0) {
        ++num_found;
        break;
      }
    }
  }
  return num_visible > 0 ? static_cast<double>(num_found) / num_visible : 0.0;
}

MatchQuality MatchMutually(const WarpedPair& pair, const PointSet& first, const PointSet& second) {
  const std::vector<size_t> forth = Nearest(first.descriptors, second.descriptors);
  const std::vector<size_t> back = Nearest(second.descriptors, first.descriptors);
  MatchQuality quality;
  for (size_t i = 0; i < first.points.size(); ++i) {
    const Eigen::Vector2d place = TruePlace(pair, first.points[i]);
    if (!IsWellInside(pair.second, place) || back[forth[i]] != i) continue;
    ++quality.num_matches;
    if ((second.points[forth[i]] - place).squaredNorm() <= 9.0) ++quality.num_inliers;
  }
  return quality;
}

}  // namespace tessera
