#include "core/id_map.h"

#include <gtest/gtest.h>

#include <string>

#include "core/ids.h"

namespace tessera {
namespace {

TEST(IdMap, FindsPutsRemovesAndWalksInOrder) {
  IdMap<LandmarkId, std::string> map;
  EXPECT_EQ(map.Find({0}), nullptr);
  EXPECT_EQ(map.Find({-1}), nullptr);
  map.Put({3}, "three");
  map.Put({1}, "one");
  map.Put({1}, "uno");
  EXPECT_EQ(map.size(), 2);
  EXPECT_EQ(*map.Find({1}), "uno");
  std::string walked;
  map.ForEach([&](LandmarkId id, const std::string& value) { walked += std::to_string(id.value) + value + " "; });
  EXPECT_EQ(walked, "1uno 3three ");
  const IdMap<LandmarkId, std::string> copy = map;
  map.Remove({1});
  map.Remove({7});
  EXPECT_EQ(map.size(), 1);
  EXPECT_FALSE(map.Has({1}));
  EXPECT_TRUE(copy.Has({1})) << "copies are values";
  EXPECT_EQ(map.end_id(), 4);
}

}  // namespace
}  // namespace tessera
