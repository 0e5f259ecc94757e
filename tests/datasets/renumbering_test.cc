#include "datasets/renumbering.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

CameraFrame FromSource(int64_t id) {
  CameraFrame frame;
  frame.id = {id};
  frame.utime_us = 40'000 * id;
  return frame;
}

TEST(Renumbering, ARestartedCameraContinuesAfterTheFramesOnTheirWay) {
  Renumbering renumbering(38);
  CameraFrame first = FromSource(0);
  renumbering.Apply(first);
  renumbering.MoveBehind({}, 0, first);
  EXPECT_EQ(first.id.value, 0) << "nothing is tracked";
  CameraFrame second = FromSource(1);
  renumbering.Apply(second);
  renumbering.MoveBehind({500}, 20'000'000, second);
  EXPECT_EQ(second.id.value, 539);
  EXPECT_GT(second.utime_us, 20'000'000 + 38 * 40'000);
  CameraFrame third = FromSource(2);
  renumbering.Apply(third);
  renumbering.MoveBehind({502}, 20'080'000, third);
  EXPECT_EQ(third.id.value, 540) << "numbers go on one by one";
  EXPECT_EQ(third.utime_us, second.utime_us + 40'000);
}

}  // namespace
}  // namespace tessera
