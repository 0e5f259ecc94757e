// Streets as polylines, and the drive along them.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/errors.h"
#include "simulation/drive.h"
#include "simulation/street_map.h"
#include "simulation/street_plan.h"
#include "support/matchers.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

const Polyline kCorner{{0.0, 0.0}, {0.0, 30.0}, {40.0, 30.0}};

TEST(Polyline, IsResampledAtEqualSteps) {
  EXPECT_DOUBLE_EQ(LengthOf(kCorner), 70.0);
  const Polyline points = Resample(kCorner, 2.0);
  ASSERT_GE(points.size(), 35U);
  EXPECT_EQ(points.front(), kCorner.front());
  for (size_t i = 1; i < 15; ++i) EXPECT_NEAR((points[i] - points[i - 1]).norm(), 2.0, 1e-9);
}

// x is to the right of someone who looks along z.
TEST(StreetMap, TellsTheWayAlongTheStreetAndTheSide) {
  const StreetMap map({kCorner});
  const StreetPosition right = map.PositionOf({2.0, 10.0}), left = map.PositionOf({-2.0, 10.0});
  EXPECT_NEAR(right.along_m, 10.0, 1e-9);
  EXPECT_NEAR(right.lateral_m, 2.0, 1e-9);
  EXPECT_NEAR(left.lateral_m, -2.0, 1e-9);
  EXPECT_NEAR(map.PositionOf({20.0, 31.0}).along_m, 50.0, 1e-9);
  EXPECT_GE(map.PositionOf({500.0, 500.0}).lateral_m, 1e3) << "no street within reach";
  EXPECT_NEAR(map.DistanceToStreet({-2.0, 10.0}), 2.0, 1e-9);
}

TEST(LookAlong, TheCameraLooksAlongZWithYDown) {
  const Rigid3 camera = LookAlong({1.0, -1.5, 2.0}, {1.0, 0.0, 0.0});
  EXPECT_THAT(camera.translation, IsNear(Eigen::Vector3d(1.0, -1.5, 2.0), 1e-12));
  EXPECT_THAT(camera.rotation * Eigen::Vector3d::UnitZ(), IsNear(Eigen::Vector3d::UnitX(), 1e-12));
  EXPECT_THAT(camera.rotation * Eigen::Vector3d::UnitY(), IsNear(Eigen::Vector3d::UnitY(), 1e-12));
}

TEST(CarTrajectory, FollowsTheDriveAndSlowsDownAtCorners) {
  const Polyline straight{{0.0, 0.0}, {0.0, 70.0}};
  const Polyline smooth_corner = Resample({{0.0, 0.0}, {0.0, 35.0}, {6.0, 41.0}, {35.0, 41.0}}, 1.0);
  const CarTrajectory direct(straight, 1.0, 3), around(smooth_corner, 1.0, 3);
  EXPECT_GT(around.duration_s() / LengthOf(smooth_corner), direct.duration_s() / LengthOf(straight));
  for (double time_s = 0.0; time_s < direct.duration_s(); time_s += 0.5) {
    EXPECT_NEAR(direct.PositionAt(time_s).x(), 0.0, 1e-9);
    EXPECT_THAT(direct.DirectionAt(time_s), IsNear(Eigen::Vector2d(0.0, 1.0), 1e-6));
    EXPECT_NEAR(direct.WorldFromCamera(time_s).translation.z(), direct.PositionAt(time_s).y(), 0.1);
    EXPECT_LT(direct.WorldFromCamera(time_s).translation.y(), -1.0) << "above the ground";
  }
}

TEST(CarTrajectory, AFasterCarTakesLess) {
  const Polyline straight{{0.0, 0.0}, {0.0, 200.0}};
  EXPECT_LT(CarTrajectory(straight, 2.0, 3).duration_s(), 0.7 * CarTrajectory(straight, 1.0, 3).duration_s());
}

TEST(PlanTown, DrivesOnStreetsAndStopsAtTheLengthAskedFor) {
  const StreetPlan plan = PlanTown(4, 300.0);
  EXPECT_NEAR(LengthOf(plan.drive), 300.0, 5.0);
  const StreetMap map(plan.streets);
  for (const Eigen::Vector2d& point : plan.drive) EXPECT_LT(map.DistanceToStreet(point), kRoadHalfWidthM + 3.0);
  EXPECT_NE(LengthOf(PlanTown(5, 0.0).drive), LengthOf(PlanTown(4, 0.0).drive));
}

TEST(PlanTown, ALongerDriveGoesTheSameWayAgain) {
  const StreetPlan once = PlanTown(4, 0.0), longer = PlanTown(4, 6000.0);
  EXPECT_NEAR(LengthOf(longer.drive), 6000.0, 1.0);
  ASSERT_EQ(longer.streets, once.streets);
  for (size_t i = 0; i + 100 < once.drive.size(); ++i) ASSERT_LT((longer.drive[i] - once.drive[i]).norm(), 1e-9) << i;
  for (size_t i = 0; i < longer.drive.size(); i += 40) {
    const auto distance = [&](const Eigen::Vector2d& point) { return (point - longer.drive[i]).norm(); };
    EXPECT_LT(distance(std::ranges::min(once.drive, {}, distance)), 0.5) << i;
  }
}

TEST(PlanRound, NoLongerDriveThanTheWayIsPromised) {
  EXPECT_NEAR(LengthOf(PlanRound(4, 100.0).drive), 100.0, 1.0);
  EXPECT_THROW(PlanRound(4, 5000.0), InputError);
  EXPECT_THROW(PlanStroll(4, 5000.0), InputError);
}

TEST(PlanFromPoses, FollowsADriveThatIsNotTooLong) {
  const TemporaryFolder folder;
  const auto plan = [&](const std::string& last) {
    folder.Write("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 " + last + "\n");
    return PlanFromPoses(folder.path("poses.txt"), 0.0);
  };
  EXPECT_NEAR(LengthOf(plan("90").drive), 90.0, 1.0);
  for (const char* last : {"1e6", "1e300"}) {
    EXPECT_THAT([&] { plan(last); }, testing::ThrowsMessage<InputError>(HasSubstr("more than 50 km"))) << last;
  }
  EXPECT_THAT([&] { plan("nobody"); }, testing::ThrowsMessage<InputError>(HasSubstr("line 2: twelve numbers")));
}

}  // namespace
}  // namespace tessera
