#include "map/spanning_tree.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <utility>
#include <vector>

#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

using Edges = std::set<std::pair<KeyframeId, KeyframeId>>;

// Keyframe i hangs below parents[i]; -1: it is a root.
Map MapOf(const std::vector<int64_t>& parents) {
  Map map;
  MapEditor editor(map);
  for (size_t i = 0; i < parents.size(); ++i) {
    const auto id = static_cast<int64_t>(i);
    editor.AddKeyframe({id}, {parents[i]}, {}, PlainFeatures(id, 1));
  }
  (void)editor.Finish({static_cast<int64_t>(parents.size()) - 1});
  return map;
}

// Whoever is the parent.
Edges EdgesOf(const Map& map) {
  Edges edges;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    if (keyframe.parent.valid()) edges.insert(std::minmax(id, keyframe.parent));
  });
  return edges;
}

TEST(SpanningTree, RootsNameTheParts) {
  const Map map = MapOf({-1, 0, 1, 1, -1, 4, 3, 5});
  for (const int64_t id : {0, 1, 2, 3, 6}) EXPECT_EQ(RootOf(map, {id}), KeyframeId{0}) << id;
  for (const int64_t id : {4, 5, 7}) EXPECT_EQ(RootOf(map, {id}), KeyframeId{4}) << id;
  EXPECT_EQ(Roots(map), (std::vector<KeyframeId>{{0}, {4}}));
  EXPECT_TRUE(Roots(Map()).empty());
}

TEST(SpanningTree, HangingATreeBelowAnotherTurnsItsPathRound) {
  Map map = MapOf({-1, 0, -1, 2, 3, 4, 4, 2});
  MapEditor editor(map);
  AttachTree({4}, {1}, editor);
  (void)editor.Finish({8});
  const std::vector<int64_t> parents{-1, 0, 3, 4, 1, 4, 4, 2};
  for (size_t i = 0; i < parents.size(); ++i) {
    EXPECT_EQ(map.FindKeyframe({static_cast<int64_t>(i)})->parent, KeyframeId{parents[i]}) << i;
  }
}

TEST(SpanningTree, HangingKeepsEveryEdgeAndJoinsTheTwo) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 generator(seed);
    std::vector<int64_t> parents{-1, -1};  // even keyframes are one part, odd ones the other
    for (int64_t i = 2; i < 40; ++i) parents.push_back(2 * (static_cast<int64_t>(generator()) % (i / 2)) + i % 2);
    Map map = MapOf(parents);
    Map replica = map;
    Edges edges = EdgesOf(map);
    const KeyframeId hung{2 * (static_cast<int64_t>(generator()) % 20) + 1};
    const KeyframeId parent{2 * (static_cast<int64_t>(generator()) % 20)};
    edges.insert(std::minmax(hung, parent));
    MapEditor editor(map);
    AttachTree(hung, parent, editor);
    EXPECT_THAT(replica.Apply(editor.Finish({40})), IsSuccess());
    EXPECT_EQ(EdgesOf(map), edges) << seed;
    EXPECT_EQ(map.FindKeyframe(hung)->parent, parent);
    for (int64_t id = 0; id < 40; ++id) {
      EXPECT_EQ(RootOf(replica, {id}), KeyframeId{0}) << seed;
      if (id % 2 == 0) {
        EXPECT_EQ(map.FindKeyframe({id})->parent.value, parents[static_cast<size_t>(id)]);
      }
    }
  }
}

}  // namespace
}  // namespace tessera
