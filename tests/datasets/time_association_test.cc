#include "datasets/time_association.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

using Indices = std::vector<int64_t>;

TEST(AssociateTimes, TakesTheNearest) {
  EXPECT_EQ(AssociateTimes({0, 50, 100}, {4, 46, 110}, 20), (Indices{0, 1, 2}));
  EXPECT_EQ(AssociateTimes({0, 50, 100}, {0, 100}, 20), (Indices{0, -1, 1}));
}

TEST(AssociateTimes, NoneIsUsedTwice) { EXPECT_EQ(AssociateTimes({0, 10, 20}, {12}, 20), (Indices{-1, 0, -1})); }

TEST(AssociateTimes, OfTwoAsNearTheEarlierOne) { EXPECT_EQ(AssociateTimes({10}, {5, 15}, 20), (Indices{0})); }

TEST(AssociateTimes, NothingIsToBeFarther) {
  EXPECT_EQ(AssociateTimes({0}, {20}, 20), (Indices{0}));
  EXPECT_EQ(AssociateTimes({0}, {21}, 20), (Indices{-1}));
  EXPECT_EQ(AssociateTimes({0, 50}, {}, 20), (Indices{-1, -1}));
  EXPECT_EQ(AssociateTimes({}, {7}, 20), Indices{});
}

}  // namespace
}  // namespace tessera
