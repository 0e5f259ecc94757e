// A hand-held camera before which people walk around.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/errors.h"
#include "simulation/drive.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

// Of the image, where people or the chair stand before the room.
double ShareOfPeople(const Rendering& with, const Rendering& without) {
  size_t num = 0;
  for (size_t i = 0; i < with.inverse_depth.pixels.size(); ++i) {
    num += with.inverse_depth.pixels[i] > 1.02F * without.inverse_depth.pixels[i] ? 1 : 0;
  }
  return static_cast<double>(num) / static_cast<double>(with.inverse_depth.pixels.size());
}

TEST(Office, PeopleFillAThirdOfTheImageAndAtMomentsHalf) {
  for (const char* seed : {"1", "2", "3"}) {
    const std::string name = std::string("office,scale=0.25,seed=") + seed;
    Simulation office(ParseSimulation(name), SensorType::kRgbd);
    Simulation empty(ParseSimulation(name + ",people=0"), SensorType::kRgbd);
    Rendering with, without;
    double sum = 0.0, largest = 0.0;
    int num = 0;
    for (int64_t frame = 0; frame < office.num_frames(); frame += 20) {
      office.RenderPerfect(FrameId{frame}, with);
      empty.RenderPerfect(FrameId{frame}, without);
      const double share = ShareOfPeople(with, without);
      sum += share;
      largest = std::max(largest, share);
      ++num;
    }
    EXPECT_GT(sum / num, 0.25) << name;
    EXPECT_LT(sum / num, 0.5) << name;
    EXPECT_GT(largest, 0.4) << name;
  }
}

TEST(Office, TheHandIsSlow) {
  const OfficeTrajectory trajectory(20.0, 1.0, 2);
  double way_m = 0.0;
  for (int frame = 0; frame < 600; ++frame) {
    const Rigid3 before = trajectory.WorldFromCamera(frame / 30.0),
                 after = trajectory.WorldFromCamera((frame + 1) / 30.0);
    const double step_m = (after.translation - before.translation).norm();
    EXPECT_LT(step_m, 0.03);
    way_m += step_m;
  }
  EXPECT_GT(way_m, 3.0);
  EXPECT_LT(way_m, 9.0);
}

TEST(AddPeople, SomeStandAtFirstAndAllWalk) {
  World world;
  AddPeople(3, 20.0, 4, world);
  ASSERT_EQ(world.movers.size(), 3U * 5U + 1U);  // a trunk, two legs, two arms each; and the chair
  int num_standing = 0;
  for (size_t person = 0; person < 3; ++person) {
    const Mover& trunk = world.movers[5 * person];
    const double at_first = trunk.position_m(0.0);
    num_standing += std::abs(trunk.position_m(0.5) - at_first) < 0.05 ? 1 : 0;
    EXPECT_GT(trunk.position_m(20.0) - at_first, 4.0);
    for (size_t limb = 1; limb < 5; ++limb) {
      for (double time_s = 0.0; time_s < 20.0; time_s += 0.3) {
        const double ahead_m = world.movers[5 * person + limb].position_m(time_s) - trunk.position_m(time_s);
        EXPECT_LT(std::abs(ahead_m), 0.35);
      }
    }
  }
  EXPECT_GE(num_standing, 1);
  const Mover& chair = world.movers.back();
  EXPECT_NEAR(chair.position_m(20.0) - chair.position_m(0.0), 0.9, 1e-9);
  World empty;
  AddPeople(0, 20.0, 4, empty);
  EXPECT_TRUE(empty.movers.empty());
}

TEST(Office, TheNumberOfPeopleIsChecked) {
  EXPECT_THROW(ParseSimulation("office,people=9"), InputError);
  EXPECT_THROW(ParseSimulation("office,people=-1"), InputError);
}

}  // namespace
}  // namespace tessera
