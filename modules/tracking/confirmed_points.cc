#include "tracking/confirmed_points.h"

#include <cstdlib>
#include <span>
#include <utility>
#include <vector>

#include "matching/frame_pose.h"

namespace tessera {
namespace {

// Of a confirmed point: large features that moved by some pixels still pass for the same, but not for long.
constexpr size_t kMinObservers = 3;
constexpr int64_t kMinStanding_us = 500'000;
constexpr int kMinConfirmed = 25;  // fewer fix no pose by themselves
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

// Of the confirmed points.
struct Inliers {
  int num_by_all = 0, num_by_confirmed = 0;
  int num_by_either = 0;  // but not by both

  // A paired test: if both poses were as good, each of those would be as likely for the one as for the other.
  bool Contradict() const {
    const int difference = num_by_confirmed - num_by_all;
    return num_by_all <= kMinShareByAll * num_by_confirmed &&
           difference * difference >= kMinSigmas * kMinSigmas * num_by_either;
  }
};

Inliers Compare(const TrackedFrame& frame, const std::vector<char>& is_confirmed, const PoseOptimizationResult& by_all,
                const PoseOptimizationResult& by_confirmed) {
  Inliers inliers;
  size_t k = 0;
  for (size_t i = 0; i < is_confirmed.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const int all = by_all.is_inlier[k], confirmed = by_confirmed.is_inlier[k];
    ++k;
    if (is_confirmed[i] == 0) continue;
    inliers.num_by_all += all;
    inliers.num_by_confirmed += confirmed;
    inliers.num_by_either += all ^ confirmed;
  }
  return inliers;
}

}  // namespace

PoseOptimizationResult OptimizeByConfirmed(const MapReplica& replica, const PoseOptimizationOptions& options,
                                           const PosePrior* prior, TrackedFrame& frame) {
  std::vector<char> is_confirmed(frame.points.size());
  int num = 0;
  for (size_t i = 0; i < is_confirmed.size(); ++i) {
    const LandmarkId id = frame.points[i].id.landmark;
    is_confirmed[i] = id.valid() && IsConfirmed(replica.map(), id) ? 1 : 0;
    num += is_confirmed[i];
  }
  PoseOptimizationResult pose = PoseByPoints(options, prior, frame);
  if (num >= kMinConfirmed && Compare(frame, is_confirmed, pose, pose).num_by_all <= kMinShareByAll * num) {
    PoseOptimizationResult by_confirmed = PoseByPoints(options, prior, frame, is_confirmed);
    const Inliers inliers = Compare(frame, is_confirmed, pose, by_confirmed);
    const bool agree = inliers.num_by_confirmed >= kMinConfirmed && inliers.num_by_confirmed > kMinAgreeing * num;
    if (agree && inliers.Contradict()) pose = std::move(by_confirmed);
  }
  TakePose(pose, frame);
  return pose;
}

}  // namespace tessera
