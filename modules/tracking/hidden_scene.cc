#include "tracking/hidden_scene.h"

#include "tracking/confirmed_points.h"

namespace tessera {
namespace {

constexpr int kTelling = 8;  // fewer confirmed points say nothing of a pose
// Of the confirmed points that were matched, those that agree (where nothing moves, at least four in ten). And of their
// share of all points that agree, what is left after a jump.
constexpr double kMinShare = 0.3;
constexpr double kSureShare = 0.8;
constexpr int64_t kMoment_us = 1'000'000;

}  // namespace

bool HiddenScene::WasConfirmed(int64_t utime_us) const {
  return confirmed_us_ && utime_us - *confirmed_us_ <= kMoment_us;
}

bool HiddenScene::IsBehind(const StepPose& pose, MotionAgreement agreement, int64_t utime_us) const {
  const bool jumps = agreement == MotionAgreement::kJumps;
  const bool goes_on = agreement == MotionAgreement::kGoesOn;
  if (is_hidden()) return jumps || (pose.num_confirmed < kMinConfirmed && !goes_on);
  if (!WasConfirmed(utime_us)) return false;
  const bool contradicts =
      pose.num_confirmed_matches >= kTelling && pose.num_confirmed < kMinShare * pose.num_confirmed_matches;
  const bool are_gone = pose.num_confirmed < kMinShare * confirmed_share_ * pose.optimized.num_inliers;
  return (contradicts && !goes_on) || (are_gone && jumps);
}

bool HiddenScene::IsSure(const StepPose& pose, MotionAgreement agreement, int64_t utime_us) const {
  return pose.num_confirmed >= kMinConfirmed && pose.num_confirmed > kSureShare * pose.num_confirmed_matches &&
         WasConfirmed(utime_us) && agreement != MotionAgreement::kJumps;
}

void HiddenScene::See(const StepPose& pose, int64_t utime_us) {
  if (hidden_us_ && utime_us - *hidden_us_ > kMoment_us) hidden_us_.reset();
  if (pose.num_confirmed < kTelling) return;
  confirmed_us_ = utime_us;
  confirmed_share_ = static_cast<double>(pose.num_confirmed) / pose.optimized.num_inliers;
}

}  // namespace tessera
