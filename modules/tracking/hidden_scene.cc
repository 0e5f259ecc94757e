#include "tracking/hidden_scene.h"

#include "tracking/confirmed_points.h"

namespace tessera {
namespace {

// Fewer confirmed points say nothing of a pose. In worlds and recordings in which nothing moves, at least four in ten
// of more agree.
constexpr int kTelling = 8;
constexpr double kMinShare = 0.3, kSureShare = 0.8;
constexpr int64_t kMoment_us = 1'000'000;

}  // namespace

bool HiddenScene::WasConfirmed(int64_t utime_us) const {
  return confirmed_us_ && utime_us - *confirmed_us_ <= kMoment_us;
}

bool HiddenScene::IsBehind(const StepPose& pose, int64_t utime_us, const std::function<bool()>& jumps) const {
  if (is_hidden()) return pose.num_confirmed < kMinConfirmed || jumps();
  if (!WasConfirmed(utime_us)) return false;
  if (pose.num_confirmed_matches < kTelling) return jumps();
  return pose.num_confirmed < kMinShare * pose.num_confirmed_matches;
}

bool HiddenScene::IsSure(const StepPose& pose, int64_t utime_us, const std::function<bool()>& jumps) const {
  return pose.num_confirmed >= kMinConfirmed && pose.num_confirmed > kSureShare * pose.num_confirmed_matches &&
         WasConfirmed(utime_us) && !jumps();
}

void HiddenScene::See(const StepPose& pose, int64_t utime_us) {
  if (hidden_us_ && utime_us - *hidden_us_ > kMoment_us) hidden_us_.reset();
  if (pose.num_confirmed >= kTelling) confirmed_us_ = utime_us;
}

}  // namespace tessera
