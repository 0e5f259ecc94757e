#include "tracking/step_pose.h"

#include <Eigen/LU>
#include <utility>

#include "tracking/confirmed_points.h"

namespace tessera {
namespace {

// Of the points that agree on a pose by themselves: fewer that agree with the motion of a moment ago contradict it.
constexpr double kMinShareWithMotion = 0.5;
// Of points that agree with one pose and with another, and of their residuals: neither is better.
constexpr double kSameShare = 0.97, kSameRms = 1.15;
// Where depth is measured, no scale can slip, and a hand jerks: what moves the image by less than this is no doubt.
constexpr double kMinDoubtfulShift_px = 10.0;

// A pose with the points that agree with it.
struct Optimized {
  PoseOptimizationResult pose;
  int num_confirmed_matches, num_confirmed;
  TrackedFrame frame;
};

Optimized Optimize(const MapReplica& replica, const PoseOptimizationOptions& options, const PosePrior* prior,
                   TrackedFrame frame) {
  PoseByConfirmed pose = OptimizeByConfirmed(replica, options, prior, frame);
  return {std::move(pose.optimized), pose.num_confirmed_matches, pose.num_confirmed, std::move(frame)};
}

// Points beside one another err alike, which no covariance knows of: a thousand of them on one wall seem to fix how the
// camera went along it by a hundredth of their noise. Whether as many agree with this pose, and nearly as well.
bool FitsAsWell(const PoseOptimizationResult& pose, const PoseOptimizationResult& other) {
  return pose.num_inliers >= kSameShare * other.num_inliers && pose.rms <= kSameRms * other.rms;
}

StepEvidence JudgeStep(const ExpectedStep& expected, const Optimized& by_images) {
  return Judge(expected.motion, expected.MotionTo(by_images.frame.world_from_camera),
               expected.CovarianceBy(by_images.pose.information));
}

bool IsFarFromExpected(const ExpectedStep& expected, const TrackedFrame& frame) {
  const Eigen::Vector3d shift = frame.world_from_camera.translation - expected.WorldFromCamera().translation;
  return frame.view->calibration().fx_px * shift.norm() > kMinDoubtfulShift_px * frame.MedianDepth();
}

}  // namespace

Rigid3 ExpectedStep::WorldFromCamera() const {
  return (world_from_reference * (reference_from_last * motion.last_from_current)).Pose();
}

PosePrior ExpectedStep::Prior() const {
  const double area = world_from_reference.scale * world_from_reference.scale;
  return {WorldFromCamera().Inverse(), (motion.covariance * area).inverse()};
}

Rigid3 ExpectedStep::MotionTo(const Rigid3& world_from_camera) const {
  return reference_from_last.Inverse() * (world_from_reference.Inverse() * world_from_camera).Pose();
}

Eigen::Matrix3d ExpectedStep::CovarianceBy(const Matrix6d& information) const {
  return TranslationCovariance(information) / (world_from_reference.scale * world_from_reference.scale);
}

StepPose OptimizeStep(const MapReplica& replica, const PoseOptimizationOptions& options, const ExpectedStep* expected,
                      TrackedFrame& frame) {
  if (expected == nullptr) {
    PoseByConfirmed pose = OptimizeByConfirmed(replica, options, nullptr, frame);
    return {std::move(pose.optimized), pose.num_confirmed_matches, pose.num_confirmed};
  }
  const PosePrior prior = expected->Prior();
  Optimized with_motion = Optimize(replica, options, &prior, frame);
  Optimized by_images = Optimize(replica, options, nullptr, with_motion.frame);
  std::optional<Optimized> by_all;  // whatever the motion makes of the points
  bool do_points_contradict = false;
  if (by_images.pose.num_inliers < kMinShareWithMotion * frame.NumPoints()) {
    by_all = Optimize(replica, options, nullptr, frame);
    do_points_contradict = by_images.pose.num_inliers < kMinShareWithMotion * by_all->pose.num_inliers;
    if (do_points_contradict) by_images = *by_all;
  }
  StepEvidence evidence = JudgeStep(*expected, by_images);
  // Mono's map is made of such steps: there it was no help.
  const bool has_depth = frame.view->baseline_m() > 0.0;
  const auto goes_as_expected = [&] { return JudgeStep(*expected, with_motion) != StepEvidence::kContradictory; };
  if (evidence == StepEvidence::kContradictory && !do_points_contradict && has_depth && goes_as_expected()) {
    if (!by_all) by_all = Optimize(replica, options, nullptr, frame);
    if (FitsAsWell(with_motion.pose, by_all->pose)) evidence = StepEvidence::kWeak;
  }
  Optimized& taken = evidence == StepEvidence::kWeak ? with_motion : by_images;
  frame = std::move(taken.frame);
  const bool is_doubtful =
      evidence == StepEvidence::kContradictory && (!has_depth || IsFarFromExpected(*expected, frame));
  return {std::move(taken.pose), with_motion.num_confirmed_matches, taken.num_confirmed, evidence, is_doubtful};
}

}  // namespace tessera
