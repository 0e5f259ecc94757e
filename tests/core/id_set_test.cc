#include "core/id_set.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "core/ids.h"

namespace tessera {
namespace {

TEST(IdSet, SaysWhetherSomethingChanged) {
  IdSet<LandmarkId> ids;
  EXPECT_FALSE(ids.Has({5}));
  EXPECT_FALSE(ids.Has({-1}));
  EXPECT_TRUE(ids.Add({5}));
  EXPECT_FALSE(ids.Add({5}));
  EXPECT_TRUE(ids.Has({5}));
  EXPECT_TRUE(ids.Remove({5}));
  EXPECT_FALSE(ids.Remove({5}));
  EXPECT_FALSE(ids.Remove({500}));
  EXPECT_TRUE(ids.Ids().empty());
}

TEST(IdSet, HoldsWhatAnOrderedSetHolds) {
  std::mt19937 generator(1);
  IdSet<KeyframeId> ids(100);
  std::set<KeyframeId> expected;
  for (int i = 0; i < 2000; ++i) {
    const KeyframeId id{static_cast<int64_t>(generator() % 300)};
    if (generator() % 3 == 0) {
      EXPECT_EQ(ids.Remove(id), expected.erase(id) == 1);
    } else {
      EXPECT_EQ(ids.Add(id), expected.insert(id).second);
    }
  }
  EXPECT_EQ(ids.Ids(), std::vector<KeyframeId>(expected.begin(), expected.end())) << "in order";
}

}  // namespace
}  // namespace tessera
