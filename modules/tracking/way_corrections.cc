#include "tracking/way_corrections.h"

#include <algorithm>

#include "tracking/pose_covariance.h"

namespace tessera {
namespace {

constexpr size_t kMaxWays = 6;
constexpr int kMinAnsweredWays = 3;  // of a map of mono

}  // namespace

void WayCorrections::BeginPart(bool is_mono) {
  ways_.clear();
  is_mono_ = is_young_ = is_mono;
}

void WayCorrections::Send(KeyframeId reference, KeyframeId keyframe, const Rigid3& reference_from_keyframe,
                          const Matrix6d& covariance) {
  ways_.push_back({reference, keyframe, reference_from_keyframe, covariance, std::nullopt});
  if (ways_.size() > kMaxWays) ways_.pop_front();
}

void WayCorrections::Update(const MapReplica& replica) {
  for (Way& way : ways_) {
    if (replica.sent().contains(way.keyframe)) continue;
    const auto world_from_reference = replica.WorldFromKeyframe(way.reference);
    const auto world_from_keyframe = replica.WorldFromKeyframe(way.keyframe);
    if (!world_from_reference || !world_from_keyframe) continue;
    way.excess = ExcessOf(way, (world_from_reference->Inverse() * *world_from_keyframe).Pose());
  }
  const auto is_answered = [](const Way& way) { return way.excess.has_value(); };
  if (std::ranges::count_if(ways_, is_answered) >= kMinAnsweredWays) is_young_ = false;
}

// In the keyframe's axes, as the covariance is.
double WayCorrections::ExcessOf(const Way& way, const Rigid3& corrected) const {
  const Rigid3 difference = way.sent.Inverse() * corrected;
  Eigen::Matrix<double, 6, 1> d;
  d << difference.translation, LogSO3(difference.rotation);
  const Eigen::Vector3d along = way.sent.rotation.conjugate() * way.sent.translation;
  return ErrorByCovariance(d, way.covariance, is_mono_ ? std::optional(along) : std::nullopt);
}

std::optional<double> WayCorrections::variance_factor() const {
  if (is_young_) return std::nullopt;
  double sum = 0.0;
  int num_answered = 0;
  for (const Way& way : ways_) {
    if (!way.excess) continue;
    sum += *way.excess;
    ++num_answered;
  }
  return num_answered == 0 ? 1.0 : std::max(1.0, sum / num_answered);
}

}  // namespace tessera
