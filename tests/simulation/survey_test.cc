#include "simulation/survey.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "simulation/simulation.h"

namespace tessera {
namespace {

TEST(Survey, LooksDownFromThirtyMetersAndComesBack) {
  const SurveyTrajectory flight(1.0, 3);
  for (double time = 0.0; time < flight.duration_s(); time += 1.0) {
    const Rigid3 pose = flight.WorldFromCamera(time);
    EXPECT_NEAR(pose.translation.y(), -30.0, 1.0);
    EXPECT_GT((pose.rotation * Eigen::Vector3d::UnitZ()).y(), 0.95);
  }
  const Eigen::Vector3d way =
      flight.WorldFromCamera(flight.duration_s()).translation - flight.WorldFromCamera(0.0).translation;
  EXPECT_LT(way.norm(), 5.0);
}

TEST(Survey, FliesTowardTheTopOfItsPictures) {
  const SurveyTrajectory flight(1.0, 3);
  for (double time = 3.0; time < 15.0; time += 1.0) {
    const Rigid3 pose = flight.WorldFromCamera(time);
    const Eigen::Vector3d step = flight.WorldFromCamera(time + 0.1).translation - pose.translation;
    EXPECT_NEAR(step.norm(), 0.6, 0.1);
    EXPECT_GT((pose.rotation * -Eigen::Vector3d::UnitY()).dot(step.normalized()), 0.95);
  }
}

TEST(Survey, SeesNearlyAPlane) {
  Simulation simulation(ParseSimulation("survey,scale=0.25"), SensorType::kMono);
  Rendering rendering;
  simulation.RenderPerfect(FrameId{100}, rendering);
  const Rigid3 pose = simulation.WorldFromCamera(FrameId{100});
  int num_ground = 0, num_seen = 0;
  for (int y = 2; y < rendering.inverse_depth.height; y += 7) {
    for (int x = 2; x < rendering.inverse_depth.width; x += 7) {
      const auto inverse_depth = static_cast<double>(rendering.inverse_depth.row(y)[x]);
      ASSERT_GT(inverse_depth, 0.0) << "the fields do not end in the picture";
      const Eigen::Vector3d point = pose * (simulation.calibration().Ray({x, y}) / inverse_depth);
      EXPECT_LT(point.y(), 0.1);
      num_ground += point.y() > -1.6 ? 1 : 0;
      ++num_seen;
    }
  }
  EXPECT_GT(num_ground, num_seen * 3 / 4);
}

TEST(Survey, OtherSeedsAreOtherFields) {
  const World one = BuildFields(1), same = BuildFields(1), other = BuildFields(2);
  EXPECT_EQ(one.surfaces.size(), same.surfaces.size());
  EXPECT_TRUE(std::equal(one.surfaces.begin(), one.surfaces.end(), same.surfaces.begin(),
                         [](const Surface& a, const Surface& b) { return a.corner == b.corner; }));
  EXPECT_FALSE(std::equal(one.surfaces.begin(), one.surfaces.end(), other.surfaces.begin(), other.surfaces.end(),
                          [](const Surface& a, const Surface& b) { return a.corner == b.corner; }));
}

}  // namespace
}  // namespace tessera
