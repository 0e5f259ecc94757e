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

 private:
  static constexpr double kInitialSigma_s = 0.01;

  double estimate_s_ = 0.0;
  double variance_ = kInitialSigma_s * kInitialSigma_s;
};

}  // namespace tessera
