#include "tracking/confirmed_points.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "matching/frame_pose.h"

namespace tessera {
namespace {

// Of a confirmed point: large features that moved by some pixels still pass for the same, but not for long.
constexpr size_t kMinObservers = 3;
constexpr int64_t kMinStanding_us = 500'000;
// The pose by all points contradicts the confirmed ones if it has less than this share of the inliers among them that
// could be had (at usual frames it has nearly all), and that isn't chance.
constexpr double kMinShareByAll = 0.95;
constexpr double kMinSigmas = 2.0;
constexpr double kMinAgreeing = 0.6;  // of the confirmed points, with the pose of their own

bool IsConfirmed(const Map& map, LandmarkId id) {
  const std::span<const Observation> observations = map.ObservationsOf(id);
  if (observations.size() < kMinObservers) return false;
  const auto seen_us = [&map](const Observation& seen) { return map.FindKeyframe(seen.keyframe)->features->utime_us; };
  // Of a loaded map, the last visit may have been filmed at an earlier time of day.
  return std::abs(seen_us(observations.back()) - seen_us(observations.front())) >= kMinStanding_us;
}

// How many of the confirmed points are inliers.
int NumInliers(const std::vector<char>& is_confirmed, const PoseOptimizationResult& pose) {
  return std::inner_product(is_confirmed.begin(), is_confirmed.end(), pose.is_inlier.begin(), 0);
}

// Whether the confirmed points' own pose fits them better, by a paired test: if it did not, those that are inliers of
// one pose only would be as likely those of the one as of the other.
bool FitsBetter(const std::vector<char>& is_confirmed, const PoseOptimizationResult& own,
                const PoseOptimizationResult& by_all) {
  int num_own = 0, num_by_all = 0;  // inliers of that pose only
  for (size_t k = 0; k < is_confirmed.size(); ++k) {
    if (is_confirmed[k] == 0) continue;
    num_own += own.is_inlier[k] > by_all.is_inlier[k] ? 1 : 0;
    num_by_all += by_all.is_inlier[k] > own.is_inlier[k] ? 1 : 0;
  }
  const int difference = num_own - num_by_all;
  return difference * difference >= kMinSigmas * kMinSigmas * (num_own + num_by_all) &&
         NumInliers(is_confirmed, by_all) <= kMinShareByAll * NumInliers(is_confirmed, own);
}

}  // namespace

int NumConfirmed(const MapReplica& replica, const TrackedFrame& frame) {
  return static_cast<int>(std::ranges::count_if(frame.points, [&](const SeenPoint& point) {
    return point.valid() && IsConfirmed(replica.map(), point.id.landmark);
  }));
}

KnownPoints OnlyConfirmed(const MapReplica& replica, KnownPoints points) {
  std::erase_if(points, [&](const auto& known) { return !IsConfirmed(replica.map(), known.first.landmark); });
  return points;
}

PoseByConfirmed OptimizeByConfirmed(const MapReplica& replica, const PoseOptimizationOptions& options,
                                    const PosePrior* prior, TrackedFrame& frame) {
  std::vector<char> is_confirmed;  // by point that the frame sees
  for (const SeenPoint& point : frame.points) {
    if (point.valid()) is_confirmed.push_back(IsConfirmed(replica.map(), point.id.landmark) ? 1 : 0);
  }
  const int num = std::accumulate(is_confirmed.begin(), is_confirmed.end(), 0);
  PoseOptimizationResult pose = PoseByPoints(options, prior, frame);
  if (num >= kMinConfirmed && NumInliers(is_confirmed, pose) <= kMinShareByAll * num) {
    PoseOptimizationResult own = PoseByPoints(options, prior, frame, is_confirmed);
    const int num_agreeing = NumInliers(is_confirmed, own);
    const bool agree = num_agreeing >= kMinConfirmed && num_agreeing > kMinAgreeing * num;
    if (agree && FitsBetter(is_confirmed, own, pose)) pose = std::move(own);
  }
  TakePose(pose, frame);
  const int num_agreeing = NumInliers(is_confirmed, pose);
  return {std::move(pose), num, num_agreeing};
}

}  // namespace tessera
