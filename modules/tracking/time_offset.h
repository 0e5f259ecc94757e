// A time that no camera tells, such as how long it takes to read an image, learned from what tracked points show.
//
// If it is wrong by d, the residuals r of a frame's points are
//
//   r = J p + d g
//
// and noise: J p comes from the error p of the frame's pose, and g tells how the residuals change with that time.
// Eliminating p gives d and its variance; a filter of one state goes on from frame to frame.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace tessera {

// What the points of one frame say.
class TimeOffsetEquations {
 public:
  struct Error {
    double seconds = 0.0;
    double variance = 0.0;  // s^2
    int num_measured = 0;
  };

  // One point: r, J, g above, divided by their standard deviations. `num_measured`: 3 with a depth, else 2.
  void Add(const Eigen::Vector3d& residual, const Eigen::Matrix<double, 3, 6>& by_pose,
           const Eigen::Vector3d& by_offset, int num_measured);
  // d. nullopt: too few points, or they don't depend on it.
  std::optional<Error> Solve() const;

 private:
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;

  Matrix6d information_ = Matrix6d::Zero();
  Vector6d coupling_ = Vector6d::Zero();  // of the pose and the offset
  Vector6d gradient_ = Vector6d::Zero();
  double offset_information_ = 0.0;
  double offset_gradient_ = 0.0;
  double sum_of_squares_ = 0.0;
  int num_points_ = 0;
  int num_measured_ = 0;
};

class TimeOffset {
 public:
  // `used_s`: what was taken out of the measurements of that frame.
  void Add(const TimeOffsetEquations& equations, double used_s);
  // 0 until it is known, to four standard deviations, that it isn't, and while it is shorter than min_s.
  double value_s(double min_s) const;
  // The share of the squares of the residuals of the last seconds that one such time explains, if nothing had been
  // taken out. With d(k), variance s(k) and the number n(k) of measurements of the frames:
  //
  //   (sum of d / s)^2 / (sum of 1 / s) / (sum of n)
  //
  // What else is wrong with poses and map may look like a time, but explains little.
  double ExplainedShare() const;
  int num_frames() const { return num_frames_; }

 private:
  static constexpr double kInitialSigma_s = 0.01;

  double estimate_s_ = 0.0;
  double variance_ = kInitialSigma_s * kInitialSigma_s;
  // Of ExplainedShare(), the latest frames counting most.
  double weighted_sum_ = 0.0, sum_of_weights_ = 0.0, sum_measured_ = 0.0;
  int num_frames_ = 0;
};

}  // namespace tessera
