#include "tracking/map_wait.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(MapWait, IsFromTheFirstLookAtAFrameThatWaits) {
  MapWait wait;
  wait.Begin(10);
  wait.Begin(20);
  EXPECT_EQ(wait.End(50), 40);
  EXPECT_EQ(wait.End(60), 0) << "the next frame did not wait";
}

TEST(MapWait, AddsUp) {
  MapWait wait;
  wait.Begin(10);
  wait.End(12);
  wait.Begin(20);
  wait.End(23);
  EXPECT_EQ(wait.total_us(), 5);
}

}  // namespace
}  // namespace tessera
