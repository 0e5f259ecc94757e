#include "tracking/ground_watch.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/quantile.h"

namespace tessera {
namespace {

constexpr double kMaxDirectionSigma_rad = 0.01;  // of steps that teach how the camera is mounted
constexpr int kMinDirections = 10;
constexpr int kMaxDirections = 300;      // of which the mean is taken
constexpr double kLevelWeight = 0.1;     // how much a camera is expected not to be rolled, and
constexpr double kForwardWeight = 0.01;  // not to look down, in place of so many directions
constexpr double kMinDown = 0.7;         // of the image's own down
constexpr double kMinDirectionVariance = 1e-5;
constexpr double kMaxSpeedSigma = 0.15;  // of the logarithm of a speed that says something of the height
constexpr size_t kNumHeights = 100;      // remembered
constexpr size_t kMinHeights = 60;       // to know it
constexpr double kMinShareNear = 0.75;
constexpr size_t kNumLatest = 20;
constexpr double kSettled = 0.15;  // in the logarithm: heights that stay about as they are
constexpr size_t kNumSteps = 600;  // remembered
constexpr double kMaxBend = 0.5;   // of the logarithm of the height
constexpr int kNumFirstSteps = 200, kStepsBetween = 4;
constexpr double kPairEvidence = 8.0;  // what one step may say if it is all there is
constexpr double kMaxLengthSigma = 0.3;
constexpr double kMinMending = 0.1;  // of the logarithm: less is what roads do to heights

double ShareNear(const std::vector<double>& log_heights, double log_height) {
  const auto num_near =
      std::ranges::count_if(log_heights, [&](double height) { return std::abs(height - log_height) < kNearHeight; });
  return static_cast<double>(num_near) / static_cast<double>(log_heights.size());
}

}  // namespace

void GroundWatch::Add(const FrameView& last, const FrameView& current, const Step& step) {
  const double length = step.last_from_current.translation.norm();
  const Eigen::Quaterniond& rotation = step.last_from_current.rotation;
  const Eigen::Vector3d seen = rotation.conjugate() * step.last_from_current.translation / length;
  if (step.is_seen && step.direction_sigma_rad < kMaxDirectionSigma_rad) LearnDirection(seen);
  // A camera that isn't carried over ground, as far as is known, is looked at now and then.
  ++num_steps_;
  const std::optional<Eigen::Vector3d> down = Down();
  const bool is_asked = down && (log_height_ || num_steps_ < kNumFirstSteps || num_steps_ % kStepsBetween == 0);
  const Rigid3 way{rotation, rotation * Direction(step, seen)};
  speed_.Add(is_asked ? SpeedOverGround(last, current, way, *down, step.interval_s) : std::nullopt, step.interval_s);
  steps_.push_back({step.reference, std::log(length / step.interval_s)});
  if (steps_.size() > kNumSteps) steps_.erase(steps_.begin());
  if (is_asked && speed_.sigma() < kMaxSpeedSigma) {
    steps_.back().log_ground_speed = speed_.log_speed();
    LearnHeight(steps_.back().log_map_speed - speed_.log_speed());
  }
}

void GroundWatch::Rescale(double factor) {
  const double change = std::log(factor);
  for (GroundStep& step : steps_) step.log_map_speed += change;
  for (double& log_height : log_heights_) log_height += change;
  if (log_height_) *log_height_ += change;
}

void GroundWatch::BeginPart(KeyframeId first, bool is_guess) {
  ForgetSteps();
  if (is_guess && log_height_) estimate_ = Estimate{first, kNumLatest};
}

void GroundWatch::ForgetSteps() {
  steps_.clear();
  log_heights_.clear();
  num_elsewhere_ = 0;
  estimate_.reset();
}

void GroundWatch::ForgetHeight() {
  ForgetSteps();
  log_height_.reset();
}

std::optional<double> GroundWatch::LengthAfterGap(const FrameView& last, const FrameView& current,
                                                  const Rigid3& last_from_current, double interval_s, double gap_s) {
  const std::optional<Eigen::Vector3d> down = Down();
  if (!log_height_ || !down) return std::nullopt;
  if (gap_s > 0.0) speed_.Add(std::nullopt, gap_s);
  speed_.Add(SpeedOverGround(last, current, last_from_current, *down, interval_s), interval_s, kPairEvidence);
  if (speed_.sigma() > kMaxLengthSigma) return std::nullopt;
  return std::exp(*log_height_ + speed_.log_speed()) * interval_s;
}

double GroundWatch::ScaleFall() const {
  if (!log_height_ || log_heights_.size() < kNumLatest || !speed_.is_plausible()) return 0.0;
  const double fall = *log_height_ - OrderStatistic({log_heights_.end() - kNumLatest, log_heights_.end()}, 0.5);
  return fall > kMaxBend ? fall : 0.0;
}

// Whether the last heights stay about as they are.
bool GroundWatch::HasSettled(size_t num_heights) const {
  if (!log_height_ || log_heights_.size() < num_heights || !speed_.is_plausible()) return false;
  const auto last = static_cast<std::ptrdiff_t>(num_heights), half = last / 2;
  const double before = OrderStatistic({log_heights_.end() - last, log_heights_.end() - half}, 0.5);
  const double change = OrderStatistic({log_heights_.end() - half, log_heights_.end()}, 0.5) - before;
  return std::abs(change) < kSettled;
}

// Whether the height was another one for so long that no road explains it.
bool GroundWatch::IsElsewhereForLong() const {
  if (!log_height_ || num_elsewhere_ < static_cast<int>(kMinHeights)) return false;
  const std::vector<double> last(log_heights_.end() - kMinHeights, log_heights_.end());
  const double median = OrderStatistic(last, 0.5);
  return std::abs(median - *log_height_) > kMaxBend && ShareNear(last, median) >= kMinShareNear;
}

std::vector<ScaleMending> GroundWatch::Mendings() const {
  if (estimate_ && HasSettled(estimate_->num_heights)) {
    const double log_factor = *log_height_ - OrderStatistic({log_heights_.begin(), log_heights_.end()}, 0.5);
    if (std::abs(log_factor) > kMinMending) return {{estimate_->since, log_factor}};
  }
  if ((ScaleFall() == 0.0 || !HasSettled(kNumLatest)) && !IsElsewhereForLong()) return {};
  return MendingsOf(steps_, *log_height_);
}

void GroundWatch::NoteMended(KeyframeId since) {
  if (!log_height_) return;
  steps_.resize(NumSound(steps_, *log_height_));
  log_heights_.clear();
  num_elsewhere_ = 0;
  const bool is_better_one = estimate_ && estimate_->since == since && estimate_->num_heights == kMinHeights;
  estimate_ = is_better_one ? std::nullopt : std::optional(Estimate{since, kMinHeights});
}

std::optional<double> GroundWatch::height() const {
  if (!log_height_) return std::nullopt;
  return std::exp(*log_height_);
}

void GroundWatch::LearnDirection(const Eigen::Vector3d& direction) {
  num_directions_ = std::min(num_directions_ + 1, kMaxDirections);
  const double share = 1.0 / num_directions_;
  direction_moments_ += share * (direction * direction.transpose() - direction_moments_);
  mean_direction_ += share * (direction - mean_direction_);
  direction_variance_ += share * (0.5 * (direction - mean_direction_).squaredNorm() - direction_variance_);
}

// The camera's direction of travel: as this step has it, and as the others had it.
Eigen::Vector3d GroundWatch::Direction(const Step& step, const Eigen::Vector3d& seen) const {
  if (num_directions_ < kMinDirections) return seen;
  if (!step.is_seen) return mean_direction_.normalized();
  const double information = 1.0 / (step.direction_sigma_rad * step.direction_sigma_rad + kMinDirectionVariance);
  const double usual_information = 1.0 / (direction_variance_ + kMinDirectionVariance);
  return (information * seen + usual_information * mean_direction_).normalized();
}

// At right angles to the directions of travel; of those that are, the one that is nearest to the image's own down.
// nullopt: the camera goes up and down, or lies on its side.
std::optional<Eigen::Vector3d> GroundWatch::Down() const {
  const double share = 1.0 / (num_directions_ + 1);
  Eigen::Matrix3d moments = direction_moments_;
  moments(0, 0) += share * kLevelWeight;
  moments(2, 2) += share * kForwardWeight;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments);
  const Eigen::Vector3d axis = solver.eigenvectors().col(0);
  if (std::abs(axis.y()) < kMinDown) return std::nullopt;
  return axis.y() < 0.0 ? Eigen::Vector3d(-axis) : axis;
}

// A height that most of the last ones are near to is known, and becomes the mean of those that are; one that none has
// been near to for long is another one.
void GroundWatch::LearnHeight(double log_height) {
  log_heights_.push_back(log_height);
  if (log_heights_.size() > kNumHeights) {
    log_heights_.pop_front();
    estimate_.reset();  // it was as good as can be
  }
  if (log_height_) {
    const bool is_near = std::abs(log_height - *log_height_) < kNearHeight;
    num_elsewhere_ = is_near ? 0 : num_elsewhere_ + 1;
    if (is_near) *log_height_ += (log_height - *log_height_) / ++num_in_height_;
    if (num_elsewhere_ >= static_cast<int>(kNumHeights)) log_height_.reset();
  }
  if (log_height_ || log_heights_.size() < kMinHeights) return;
  const double median = OrderStatistic({log_heights_.begin(), log_heights_.end()}, 0.5);
  const double share_near = ShareNear({log_heights_.begin(), log_heights_.end()}, median);
  if (share_near < kMinShareNear) return;
  log_height_ = median;
  num_in_height_ = static_cast<int>(share_near * static_cast<double>(log_heights_.size()) + 0.5);
  num_elsewhere_ = 0;
}

}  // namespace tessera
