// Pairs of images related by a known homography, and how well features find each other again across them.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/image.h"
#include "features/feature_types.h"

namespace tessera {

// second(p') = first(p) with p' = second_from_first * p (homogeneous pixels), except for brightness and noise.
struct WarpedPair {
  std::string name;
  GrayImage first;
  GrayImage second;
  Eigen::Matrix3d second_from_first;
};

// The image under several motions: shift, rotation, scale, perspective; each with a change of brightness and noise.
std::vector<WarpedPair> MakeWarpedPairs(const GrayImage& image);

// Keypoints in level-0 pixels with their descriptors.
struct PointSet {
  std::vector<Eigen::Vector2d> points;
  std::vector<Descriptor> descriptors;
};

PointSet ExtractTessera(const GrayImage& image, const FeatureOptions& options);
PointSet ExtractCvOrb(const GrayImage& image, const FeatureOptions& options);
// cv::ORB's descriptors and orientation at the keypoints that Tessera finds.
PointSet ExtractCvOrbAtTessera(const GrayImage& image, const FeatureOptions& options);

// Share of the first image's points, of those whose true place in the second lies kBorderPx inside it, that have a
// point within 2 px of that place.
double Repeatability(const WarpedPair& pair, const PointSet& first, const PointSet& second);

// Of the mutually nearest descriptors: how many lie within 3 px of their true place.
struct MatchQuality {
  int num_matches = 0;
  int num_inliers = 0;
  double InlierShare() const { return num_matches > 0 ? static_cast<double>(num_inliers) / num_matches : 0.0; }
};
MatchQuality MatchMutually(const WarpedPair& pair, const PointSet& first, const PointSet& second);

}  // namespace tessera
