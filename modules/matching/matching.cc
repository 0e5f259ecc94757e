#include "matching/matching.h"

#include <algorithm>
#include <array>

namespace tessera {
std::vector<Match> MatchInWindow(const FrameView& first, std::span<const Eigen::Vector2d> centers_px,
                                 const FrameView& second, double radius_px, const MatchingOptions& options) {
  std::vector<Match> matches;
  for (int i = 0; i < first.size(); ++i) {
    const int level = first.keypoint(i).level;
    const PatchRange range = PatchRange::Levels(level - 1, level + 1);
    BestMatch best;
    second.grid().VisitWindow(centers_px[static_cast<size_t>(i)], radius_px, range, [&](const PlacedKeypoint& to) {
      best.Offer(to.index, HammingDistance(first.descriptor(i), second.descriptor(to.index)));
    });
    if (best.IsClear(options)) {
      matches.push_back({i, best.index, best.distance});
    }
  }
  return KeepRotationInliers(KeepBestPerSecond(std::move(matches), second.size()), first, second, options);
}

std::vector<Match> KeepBestPerSecond(std::vector<Match> matches, int num_second) {
  std::vector<int32_t> best(static_cast<size_t>(num_second), -1);  // by second: index into matches
  for (size_t i = 0; i < matches.size(); ++i) {
    int32_t& holder = best[static_cast<size_t>(matches[i].second)];
    if (holder < 0 || matches[i].distance < matches[static_cast<size_t>(holder)].distance) {
      holder = static_cast<int32_t>(i);
    }
  }
  std::vector<Match> kept;
  kept.reserve(matches.size());
  for (size_t i = 0; i < matches.size(); ++i) {
    if (best[static_cast<size_t>(matches[i].second)] == static_cast<int32_t>(i)) {
      kept.push_back(matches[i]);
    }
  }
  return kept;
}

std::vector<Match> KeepRotationInliers(std::vector<Match> matches, const FrameView& first, const FrameView& second,
                                       const MatchingOptions& options) {
  if (!options.check_rotation) {
    return matches;
  }
  std::vector<uint8_t> rotations;
  rotations.reserve(matches.size());
  for (const Match& match : matches) {
    rotations.push_back(static_cast<uint8_t>(second.keypoint(match.second).angle - first.keypoint(match.first).angle));
  }
  const std::vector<char> is_inlier = RotationHistogramInliers(rotations);
  size_t kept = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (is_inlier[i]) {
      matches[kept++] = matches[i];
    }
  }
  matches.resize(kept);
  return matches;
}

std::vector<char> RotationHistogramInliers(std::span<const uint8_t> rotations) {
  constexpr int kBins = 32, kBinSize = 256 / kBins;
  std::array<int, kBins> count{};
  for (const uint8_t rotation : rotations) {
    ++count[rotation / kBinSize];
  }
  // The fullest bin together with its two neighbors, since the peak may lie on a border.
  int best = 0, best_count = -1;
  for (int bin = 0; bin < kBins; ++bin) {
    const auto at = [&](int s) { return count[static_cast<size_t>((s + kBins) % kBins)]; };
    const int sum = at(bin - 1) + at(bin) + at(bin + 1);
    if (sum > best_count) {
      best = bin;
      best_count = sum;
    }
  }
  std::vector<char> is_inlier(rotations.size());
  std::transform(rotations.begin(), rotations.end(), is_inlier.begin(), [best](uint8_t rotation) {
    const int distance = (rotation / kBinSize - best + kBins) % kBins;
    return static_cast<char>(distance <= 1 || distance == kBins - 1);
  });
  return is_inlier;
}

}  // namespace tessera
