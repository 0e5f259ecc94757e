// Which places are candidates, on maps and bags of words that are planted.
#include "loop_closing/place_candidates.h"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>
#include <vector>

#include "map/map_editor.h"
#include "support/map_changes.h"

namespace tessera {
namespace {

using Words = std::set<int32_t>;

// Ten words that start at `first`, of which `num_other` are others, which no image but those with the same `first` and
// `other` has.
Words TenWords(int32_t first, int num_other = 0, int32_t other = 1000) {
  Words words;
  for (int32_t i = 0; i < 10; ++i) words.insert(i < 10 - num_other ? first + i : 100 * other + first + i);
  return words;
}

// Keyframes with planted bags, and landmarks that chosen groups of them share.
class PlantedPlaces {
 public:
  KeyframeId Add(const Words& words) {
    const KeyframeId id{map_.keyframes().end_id()};
    MapEditor editor(map_);
    editor.AddKeyframe(id, {id.value - 1}, {}, PlainFeatures(id.value, 400));
    (void)editor.Finish(id);
    BagOfWords bag;
    for (const int32_t word : words) bag.words.emplace_back(word, 1.0F / static_cast<float>(words.size()));
    places_.Add(id, std::make_shared<const BagOfWords>(bag));
    return id;
  }
  void Share(const std::vector<int64_t>& keyframes, int num_landmarks) {
    MapEditor editor(map_);
    for (int i = 0; i < num_landmarks; ++i) {
      const LandmarkId landmark = editor.AddLandmark({});
      for (const int64_t id : keyframes) editor.AddObservation(landmark, {{id}, used_[id]++});
    }
    (void)editor.Finish(map_.answered());
  }
  Candidates Find(int64_t id, const CandidateOptions& options = {}) const {
    return FindLoopCandidates(map_, places_, {id}, options);
  }

  const Map& map() const { return map_; }
  PlaceDatabase& places() { return places_; }

 private:
  Map map_;
  PlaceDatabase places_;
  std::map<int64_t, int32_t> used_;  // keypoints
};

// Keyframes 0 .. 4 are one place, 5 .. 9 a way, on which each looks different and shares landmarks with the next, and
// 10 .. 12 look like the place again, keyframe 12 most like keyframe 2.
PlantedPlaces RoundTrip(int num_alike_before = 2) {
  PlantedPlaces places;
  for (const int num_other : {2, 1, 0, 1, 2}) places.Add(TenWords(0, num_other));
  places.Share({0, 1, 2, 3, 4}, 30);
  for (int32_t i = 0; i < 5; ++i) places.Add(TenWords(100 + 20 * i));
  for (int64_t k = 4; k < 9; ++k) places.Share({k, k + 1}, 20);
  places.Add(num_alike_before >= 2 ? TenWords(0, 3, 7) : TenWords(300, 3, 7));
  places.Add(num_alike_before >= 1 ? TenWords(0, 2, 7) : TenWords(300, 2, 7));
  places.Add(TenWords(0));
  places.Share({10, 11, 12}, 30);
  return places;
}

TEST(PlaceCandidates, APlaceSeenAgainIsNamedByItsBestKeyframe) {
  const PlantedPlaces places = RoundTrip();
  const Candidates found = places.Find(12);
  EXPECT_EQ(found.num_found, 1);
  EXPECT_EQ(found.keyframes, (std::vector<KeyframeId>{{2}}));
}

TEST(PlaceCandidates, KeyframesBeforeMustHaveTheSamePlace) {
  for (const int num_alike : {0, 1}) {
    const Candidates found = RoundTrip(num_alike).Find(12);
    EXPECT_TRUE(found.keyframes.empty()) << num_alike;
  }
  CandidateOptions lax;
  lax.num_consistent = 0;
  EXPECT_EQ(RoundTrip(2).Find(12, lax).keyframes.size(), 1U);
}

TEST(PlaceCandidates, TooFewKeyframesBeforeAreNotConsistent) {
  PlantedPlaces places;
  for (int i = 0; i < 3; ++i) places.Add(TenWords(0));
  places.Share({0, 1, 2}, 30);
  places.Add(TenWords(0));
  places.Add(TenWords(0));
  places.Share({3, 4}, 30);
  const Candidates found = places.Find(4);
  EXPECT_EQ(found.num_found, 1);
  EXPECT_TRUE(found.keyframes.empty()) << "keyframe 3 alone does not show that the similarity lasts";
}

TEST(PlaceCandidates, NeighborsAndTheirNeighborsAreNoCandidates) {
  PlantedPlaces places;
  for (int i = 0; i < 6; ++i) places.Add(TenWords(0));
  places.Share({0, 1, 2}, 30);
  places.Share({2, 3}, 30);
  places.Share({3, 4, 5}, 30);
  EXPECT_EQ(places.Find(3).num_found, 0);
  // Keyframe 2 is a neighbor of a neighbor; 0 and 1 are one step farther.
  CandidateOptions lax;
  lax.num_consistent = 0;
  const Candidates found = places.Find(5, lax);
  for (const KeyframeId id : found.keyframes) EXPECT_TRUE(id == KeyframeId{0} || id == KeyframeId{1}) << id.value;
  EXPECT_FALSE(found.keyframes.empty());
  lax.min_shared_landmarks = 31;  // then they share too little to be neighbors
  EXPECT_GT(places.Find(5, lax).num_found, 0);
  EXPECT_EQ(places.Find(5, lax).keyframes.front(), KeyframeId{0});
}

TEST(PlaceCandidates, WhatLooksLessAlikeThanANeighborIsNone) {
  PlantedPlaces places = RoundTrip();
  EXPECT_EQ(places.Find(12).num_found, 1);
  PlantedPlaces other;
  for (int i = 0; i < 3; ++i) other.Add(TenWords(0, 4));
  other.Share({0, 1, 2}, 30);
  for (const int num_other : {2, 1, 0}) other.Add(TenWords(0, num_other, 7));
  other.Share({3, 4, 5}, 30);
  EXPECT_EQ(other.Find(5).num_found, 0) << "six words in common, where the neighbors have eight";
}

TEST(PlaceCandidates, LaterKeyframesDoNotChangeTheAnswer) {
  PlantedPlaces places = RoundTrip();
  const Candidates before = places.Find(12);
  places.Add(TenWords(0));
  places.Add(TenWords(0));
  places.Share({12, 13, 14}, 30);
  const Candidates after = places.Find(12);
  EXPECT_EQ(after.keyframes, before.keyframes);
  EXPECT_EQ(after.num_found, before.num_found);
}

// One image that looks alike is weaker than a place of which several do.
TEST(PlaceCandidates, APlaceIsWorthMoreThanOneImage) {
  PlantedPlaces places;
  places.Add(TenWords(0, 1));  // alone
  for (int i = 0; i < 3; ++i) places.Add(TenWords(0, 2, 5));
  places.Share({1, 2, 3}, 30);
  const std::vector<KeyframeId> found = FindPlaces(places.map(), places.places(), *places.places().Find({0}), {});
  ASSERT_FALSE(found.empty());
  BagOfWords image;
  for (const int32_t word : TenWords(0)) image.words.emplace_back(word, 0.1F);
  EXPECT_EQ(FindPlaces(places.map(), places.places(), image, {}), (std::vector<KeyframeId>{{1}}));
  CandidateOptions lax;
  lax.min_group_share = 0.1;
  EXPECT_EQ(FindPlaces(places.map(), places.places(), image, lax), (std::vector<KeyframeId>{{1}, {0}}));
  lax.max_candidates = 1;
  EXPECT_EQ(FindPlaces(places.map(), places.places(), image, lax), (std::vector<KeyframeId>{{1}}));
  EXPECT_TRUE(FindPlaces(places.map(), places.places(), BagOfWords{}, {}).empty());
}

TEST(PlaceCandidates, NobodyIsACandidateOfAKeyframeWithoutABag) {
  PlantedPlaces places = RoundTrip();
  places.places().Remove({12});
  EXPECT_EQ(places.Find(12).num_found, 0);
}

}  // namespace
}  // namespace tessera
