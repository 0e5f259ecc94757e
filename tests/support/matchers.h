// Matchers, so that an expectation is one sentence:
//
//   EXPECT_THAT(estimate.first_from_second, IsNear(truth, 1e-3));
//   EXPECT_THAT(replica.Apply(delta), IsSuccess());
//   EXPECT_THAT(options.Check(), IsFailure(HasSubstr("must be positive")));
#pragma once

#include <gmock/gmock.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "core/result.h"
#include "geometry/rigid3.h"

namespace tessera {

using testing::HasSubstr;

namespace matcher_impl {

// The largest of the differences that IsNear() bounds, and how it is called.
struct Difference {
  double value = 0.0;
  const char* of = "position";
};

inline Difference Larger(const Difference& a, const Difference& b) { return b.value > a.value ? b : a; }

template <class DerivedA, class DerivedB>
Difference Between(const Eigen::MatrixBase<DerivedA>& a, const Eigen::MatrixBase<DerivedB>& b) {
  return {(a - b).norm(), "position"};
}
inline Difference Between(const Rigid3& a, const Rigid3& b) {
  return Larger({(a.translation - b.translation).norm(), "translation"},
                {a.rotation.angularDistance(b.rotation), "rotation [rad]"});
}
inline Difference Between(const Sim3& a, const Sim3& b) {
  return Larger(Between(a.Pose(), b.Pose()), {std::abs(a.scale / b.scale - 1.0), "scale"});
}

}  // namespace matcher_impl

// Vectors: at most `tolerance` apart. Transforms: translation (in its unit), rotation (radians) and scale (as a ratio)
// differ by `tolerance` each at most.
MATCHER_P2(IsNear, expected, tolerance, "") {
  const matcher_impl::Difference difference = matcher_impl::Between(arg, expected);
  *result_listener << "whose " << difference.of << " is " << difference.value << " off";
  return difference.value <= tolerance;
}

MATCHER(IsSuccess, "") {
  if (!arg.has_value()) *result_listener << "which failed: " << arg.error().sentence;
  return arg.has_value();
}

// A failed Result whose sentence matches.
MATCHER_P(IsFailure, sentence, "") {
  if (arg.has_value()) {
    *result_listener << "which succeeded";
    return false;
  }
  return testing::ExplainMatchResult(sentence, arg.error().sentence, result_listener);
}

}  // namespace tessera
