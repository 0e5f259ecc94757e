// What two views of a road say of the speed.
#include "matching/ground_speed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/synthetic_road.h"

namespace tessera {
namespace {

constexpr double kInterval_s = 0.1;

double SpeedAt(size_t i) { return kMinGroundSpeed * std::exp(kGroundSpeedStep * (static_cast<double>(i) + 0.5)); }

size_t BestOf(const GroundSpeeds& speeds) {
  return static_cast<size_t>(std::max_element(speeds.begin(), speeds.end()) - speeds.begin());
}

// By how much any speed that differs by more than a quarter is less likely than the best.
double Margin(const GroundSpeeds& speeds) {
  const size_t best = BestOf(speeds);
  double rival = 0.0;
  for (size_t i = 0; i < speeds.size(); ++i) {
    if (std::abs(std::log(SpeedAt(i) / SpeedAt(best))) > 0.25) rival = std::max(rival, speeds[i]);
  }
  return speeds[best] - rival;
}

std::optional<GroundSpeeds> Speeds(SyntheticRoad& road, double step_m, double pitch_rad) {
  const Rigid3 before = SyntheticRoad::Pose(20.0, pitch_rad), now = SyntheticRoad::Pose(20.0 + step_m, pitch_rad);
  const Eigen::Vector3d down = now.rotation.conjugate() * Eigen::Vector3d::UnitY();
  Rigid3 last_from_current = before.Inverse() * now;
  last_from_current.translation *= 7.0;  // its length isn't known
  return SpeedOverGround(*road.Take(before), *road.Take(now), last_from_current, down, kInterval_s);
}

TEST(GroundSpeed, IsToldInHeightsASecond) {
  for (const double step_m : {0.3, 1.0, 2.5}) {
    for (const double pitch_rad : {0.0, 0.2}) {
      SyntheticRoad road(2000);
      const auto speeds = Speeds(road, step_m, pitch_rad);
      ASSERT_TRUE(speeds);
      const double truth = step_m / SyntheticRoad::kHeight_m / kInterval_s;
      EXPECT_NEAR(std::log(SpeedAt(BestOf(*speeds)) / truth), 0.0, 0.06) << step_m << " m, " << pitch_rad << " rad";
      EXPECT_GT(Margin(*speeds), 10.0);
    }
  }
}

TEST(GroundSpeed, AFewPointsAreEnough) {
  SyntheticRoad road(100);
  const auto speeds = Speeds(road, 1.0, 0.0);
  ASSERT_TRUE(speeds);
  EXPECT_NEAR(std::log(SpeedAt(BestOf(*speeds)) * SyntheticRoad::kHeight_m * kInterval_s), 0.0, 0.1);
}

// Rows of the same stones: what is 1 m further could as well be 4 m further.
TEST(GroundSpeed, ARoadThatRepeatsItselfLeavesSeveralAnswersWithTheTrueOneAmongThem) {
  SyntheticRoad road(2000), rows(2000, 3.0);
  const auto clear = Speeds(road, 1.0, 0.0), repeated = Speeds(rows, 1.0, 0.0);
  ASSERT_TRUE(clear && repeated);
  EXPECT_LT(Margin(*repeated), 0.5 * Margin(*clear));
  double at_truth = 0.0;
  for (size_t i = 0; i < repeated->size(); ++i) {
    const double off = std::log(SpeedAt(i) * SyntheticRoad::kHeight_m * kInterval_s);
    if (std::abs(off) < 0.06) at_truth = std::max(at_truth, (*repeated)[i]);
  }
  EXPECT_GT(at_truth, 0.7 * (*repeated)[BestOf(*repeated)]);
}

TEST(GroundSpeed, IsNotToldWithoutGroundOrAWay) {
  SyntheticRoad bare(0);
  EXPECT_FALSE(Speeds(bare, 1.0, 0.0));
  SyntheticRoad road(2000);
  EXPECT_FALSE(Speeds(road, 0.0, 0.0));
}

}  // namespace
}  // namespace tessera
