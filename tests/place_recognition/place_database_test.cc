#include "place_recognition/place_database.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <stdexcept>

namespace tessera {
namespace {

constexpr int32_t kNumWords = 200;

bool AcceptAll(KeyframeId) { return true; }

// 30 words of which the low ones are drawn most often, as some words are in real images.
std::shared_ptr<const BagOfWords> RandomBag(std::mt19937_64& generator) {
  std::set<int32_t> words;
  while (words.size() < 30) {
    const auto word = static_cast<int32_t>(generator() % kNumWords);
    words.insert(std::min(word, static_cast<int32_t>(generator() % kNumWords)));
  }
  BagOfWords bag;
  double sum = 0.0;
  for (const int32_t word : words) {
    bag.words.emplace_back(word, static_cast<float>(1 + generator() % 1000));
    sum += static_cast<double>(bag.words.back().second);
  }
  for (auto& [word, weight] : bag.words) weight = static_cast<float>(static_cast<double>(weight) / sum);
  return std::make_shared<const BagOfWords>(bag);
}

using Bags = std::map<KeyframeId, std::shared_ptr<const BagOfWords>>;

Bags RandomBags(int count, uint64_t seed) {
  std::mt19937_64 generator(seed);
  Bags bags;
  for (int i = 0; i < count; ++i) bags[KeyframeId{3 * i}] = RandomBag(generator);
  return bags;
}

int32_t CountCommon(const BagOfWords& a, const BagOfWords& b) {
  int32_t count = 0;
  for (const auto& [word, weight] : a.words) {
    count +=
        std::any_of(b.words.begin(), b.words.end(), [&](const auto& other) { return other.first == word; }) ? 1 : 0;
  }
  return count;
}

std::vector<PlaceDatabase::Place> QueryByBruteForce(const Bags& bags, const BagOfWords& bag,
                                                    const std::function<bool(KeyframeId)>& accepts, double min_share) {
  std::vector<PlaceDatabase::Place> places;
  int32_t most = 0;
  for (const auto& [id, other] : bags) {
    if (!accepts(id)) continue;
    places.push_back({id, CountCommon(bag, *other), Similarity(bag, *other)});
    most = std::max(most, places.back().num_common_words);
  }
  std::erase_if(places, [&](const auto& place) {
    return place.num_common_words == 0 || place.num_common_words < min_share * most;
  });
  std::stable_sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  return places;
}

TEST(PlaceDatabase, AnswersAsBruteForceDoes) {
  const Bags bags = RandomBags(80, 1);
  PlaceDatabase database;
  for (const auto& [id, bag] : bags) database.Add(id, bag);
  const auto accepts_even = [](KeyframeId id) { return id.value % 2 == 0; };
  std::mt19937_64 generator(2);
  for (int i = 0; i < 20; ++i) {
    const auto bag = RandomBag(generator);
    for (const double share : {0.0, 0.5, 0.8, 1.0}) {
      EXPECT_EQ(database.Query(*bag, AcceptAll, share), QueryByBruteForce(bags, *bag, AcceptAll, share));
      EXPECT_EQ(database.Query(*bag, accepts_even, share), QueryByBruteForce(bags, *bag, accepts_even, share));
    }
  }
}

TEST(PlaceDatabase, HistoryDoesNotMatter) {
  const Bags bags = RandomBags(40, 3), strangers = RandomBags(40, 4);
  PlaceDatabase straight, tangled;
  for (const auto& [id, bag] : bags) straight.Add(id, bag);
  for (const auto& [id, bag] : strangers) tangled.Add(id, bag);
  for (auto entry = bags.rbegin(); entry != bags.rend(); ++entry) {
    tangled.Remove(entry->first);
    tangled.Add(entry->first, entry->second);
  }
  EXPECT_EQ(tangled.size(), straight.size());
  for (const auto& [id, bag] : bags) EXPECT_EQ(tangled.Query(*bag, AcceptAll), straight.Query(*bag, AcceptAll));
}

TEST(PlaceDatabase, BestPlaceOfAKnownBagIsItself) {
  const Bags bags = RandomBags(40, 5);
  PlaceDatabase database;
  for (const auto& [id, bag] : bags) database.Add(id, bag);
  for (const auto& [id, bag] : bags) {
    EXPECT_EQ(database.Query(*bag, AcceptAll).front().id, id);
    EXPECT_EQ(database.Find(id), bag.get());
  }
}

TEST(PlaceDatabase, TiesGoToTheOlderKeyframe) {
  std::mt19937_64 generator(6);
  const auto bag = RandomBag(generator);
  PlaceDatabase database;
  for (const int64_t id : {9, 4, 7}) database.Add(KeyframeId{id}, bag);
  const auto places = database.Query(*bag, AcceptAll);
  ASSERT_EQ(places.size(), 3U);
  EXPECT_EQ(places[0].id, KeyframeId{4});
  EXPECT_EQ(places[1].id, KeyframeId{7});
  EXPECT_EQ(places[2].id, KeyframeId{9});
}

TEST(PlaceDatabase, ForgetsWhatIsRemoved) {
  std::mt19937_64 generator(7);
  const auto bag = RandomBag(generator);
  PlaceDatabase database;
  database.Add(KeyframeId{1}, bag);
  database.Remove(KeyframeId{1});
  database.Remove(KeyframeId{2});  // was never there
  EXPECT_EQ(database.size(), 0U);
  EXPECT_EQ(database.Find(KeyframeId{1}), nullptr);
  EXPECT_TRUE(database.Query(*bag, AcceptAll).empty());
}

TEST(PlaceDatabase, RefusesAKeyframeTwice) {
  std::mt19937_64 generator(8);
  PlaceDatabase database;
  database.Add(KeyframeId{1}, RandomBag(generator));
  EXPECT_THROW(database.Add(KeyframeId{1}, RandomBag(generator)), std::invalid_argument);
}

TEST(PlaceDatabase, AcceptsIsOnlyAskedForThoseInIt) {
  const Bags bags = RandomBags(10, 9);
  PlaceDatabase database;
  for (const auto& [id, bag] : bags) database.Add(id, bag);
  database.Remove(KeyframeId{0});
  database.Query(*bags.begin()->second, [&](KeyframeId id) {
    EXPECT_NE(database.Find(id), nullptr);
    return true;
  });
}

}  // namespace
}  // namespace tessera
