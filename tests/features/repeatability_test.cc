// Keypoints and descriptors are at least as good as cv::ORB's on images under known motion.
#include <gtest/gtest.h>

#include <cstdio>

#include "support/feature_images.h"
#include "support/warped_pairs.h"

namespace tessera {
namespace {

constexpr int kNumFeatures[] = {1000, 2000};

// Means over all pairs that are made of the images.
struct Quality {
  double repeatability = 0.0;
  double inlier_share = 0.0;
};

template <class Extract>
Quality Measure(const std::vector<GrayImage>& images, const FeatureOptions& options, Extract extract) {
  Quality sum;
  int num_pairs = 0;
  for (const GrayImage& image : images) {
    for (const WarpedPair& pair : MakeWarpedPairs(image)) {
      const PointSet first = extract(pair.first, options);
      const PointSet second = extract(pair.second, options);
      sum.repeatability += Repeatability(pair, first, second);
      sum.inlier_share += MatchMutually(pair, first, second).InlierShare();
      ++num_pairs;
    }
  }
  return {sum.repeatability / num_pairs, sum.inlier_share / num_pairs};
}

void ExpectAtLeastCvOrb(const char* name, const std::vector<GrayImage>& images) {
  for (const int num_features : kNumFeatures) {
    const FeatureOptions options{.num_features = num_features};
    const Quality tessera = Measure(images, options, ExtractTessera);
    const Quality orb = Measure(images, options, ExtractCvOrb);
    const Quality orb_descriptors = Measure(images, options, ExtractCvOrbAtTessera);
    std::printf(
        "%s, %d keypoints: repeatability %.3f (cv::ORB %.3f), inliers among matches %.3f (cv::ORB %.3f, its "
        "descriptors at our keypoints %.3f)\n",
        name, num_features, tessera.repeatability, orb.repeatability, tessera.inlier_share, orb.inlier_share,
        orb_descriptors.inlier_share);
    EXPECT_GE(tessera.repeatability, orb.repeatability) << name;
    EXPECT_GE(tessera.inlier_share, orb.inlier_share) << name;
    EXPECT_GE(tessera.inlier_share, orb_descriptors.inlier_share - 0.01) << name;
  }
}

TEST(Repeatability, OfMadeImages) { ExpectAtLeastCvOrb("made", {MakeTexture(752, 480, 3), MakeTexture(1241, 376, 4)}); }

TEST(Repeatability, OfRealImages) {
  std::vector<GrayImage> images;
  for (const int frame : {20, 150, 420, 640}) {
    const std::optional<GrayImage> image = ReadKittiImage(frame);
    if (!image) GTEST_SKIP() << "KITTI sequence 03 is not in " TESSERA_DATA;
    images.push_back(*image);
  }
  for (const char* path : {"euroc/MH_01/mav0/cam0/data/1403636584763555584.jpg", "rgbd/kitchen/rgb/0.033333.jpg"}) {
    const std::optional<GrayImage> image = ReadRealImage(path);
    if (!image) GTEST_SKIP() << path << " is not in " TESSERA_DATA;
    images.push_back(*image);
  }
  ExpectAtLeastCvOrb("real", images);
}

}  // namespace
}  // namespace tessera
