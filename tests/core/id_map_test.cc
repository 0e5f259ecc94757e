#include "core/id_map.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

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

TEST(IdMap, ValuesStayWhereTheyAreWhileOthersComeAndGo) {
  IdMap<LandmarkId, std::string> map;
  std::vector<const std::string*> places;
  for (int64_t i = 0; i < 1000; ++i) places.push_back(&map.Put({i}, std::to_string(i)));
  for (int64_t i = 0; i < 1000; i += 2) map.Remove({i});
  for (int64_t i = 1000; i < 3000; ++i) map.Put({i}, std::to_string(i));
  EXPECT_EQ(map.size(), 2500);
  for (int64_t i = 1; i < 1000; i += 2) EXPECT_EQ(map.Find({i}), places[static_cast<size_t>(i)]);
  map.ForEach([](LandmarkId id, const std::string& value) { EXPECT_EQ(value, std::to_string(id.value)); });
}

// All ids below 6400 of which one in a hundred stays, among many that come and go.
TEST(IdMap, WalksAndFindsAcrossStretchesOfRemovedIds) {
  IdMap<LandmarkId, int64_t> map;
  for (int64_t i = 0; i < 6400; ++i) {
    map.Put({i}, i);
    if (i >= 10 && (i - 10) % 100 != 0) map.Remove({i - 10});
  }
  for (int64_t i = 6390; i < 6400; ++i) map.Remove({i});
  std::vector<int64_t> walked;
  IdMap<LandmarkId, int64_t> copy = map;
  copy.ForEach([&](LandmarkId id, int64_t value) {
    EXPECT_EQ(id.value, value);
    walked.push_back(value);
  });
  EXPECT_EQ(walked.size(), 64u);
  EXPECT_EQ(map.size(), 64);
  EXPECT_EQ(copy.end_id(), 6400) << "no id is given twice";
  EXPECT_TRUE(map.Has({6300}));
  EXPECT_FALSE(map.Has({6299}));
  copy.Put({6299}, 6299);
  EXPECT_TRUE(copy.Has({6299}));
  EXPECT_FALSE(map.Has({6299}));
}

TEST(IdMap, ARemovedValueLetsGoOfWhatItHeld) {
  const auto held = std::make_shared<int>(1);
  IdMap<LandmarkId, std::shared_ptr<int>> map;
  map.Put({0}, held);
  map.Remove({0});
  EXPECT_EQ(held.use_count(), 1);
}

}  // namespace
}  // namespace tessera
