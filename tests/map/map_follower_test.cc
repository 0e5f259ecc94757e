#include "map/map_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "map/map_archive.h"
#include "map/random_changes.h"
#include "map/removed_keyframes.h"

namespace tessera {
namespace {

// The owner of a map that changes at random.
class Owner {
 public:
  explicit Owner(unsigned seed) : generator_(seed) {}

  MapFollower::Delta Next() {
    auto delta = std::make_shared<const MapDelta>(RandomChange(map_, generator_));
    archive_.Add(delta, map_);
    return delta;
  }
  void Answer(const MapRequest& request, MapFollower& follower) {
    const MapArchive::Answer answer = archive_.AnswerTo(request, map_);
    num_pages_ += answer.page ? 1 : 0;
    for (const auto& delta : answer.deltas) follower.Receive(delta);
    if (answer.page) follower.Receive(*answer.page);
  }
  const Map& map() const { return map_; }
  int num_pages() const { return num_pages_; }

 private:
  std::mt19937 generator_;
  Map map_;
  MapArchive archive_;
  int num_pages_ = 0;
};

// Applies what can be applied. Returns what was wrong.
std::string Update(MapFollower& follower, Map& replica) {
  for (const auto& delta : follower.Take()) {
    if (std::string problem = replica.Apply(*delta); !problem.empty()) {
      follower.Reject();
      return problem;
    }
  }
  return "";
}

void ExpectEqual(const Map& replica, const Map& owner) {
  EXPECT_EQ(replica.next_delta(), owner.next_delta());
  EXPECT_EQ(replica.hash(), owner.hash());
  EXPECT_EQ(replica.Sha256Hex(), owner.Sha256Hex());
  EXPECT_EQ(replica.answered(), owner.answered());
}

TEST(MapFollower, PutsDeltasInOrderEachOnce) {
  Owner owner(1);
  std::vector<MapFollower::Delta> deltas;
  for (int i = 0; i < 30; ++i) deltas.push_back(owner.Next());
  for (unsigned seed = 0; seed < 5; ++seed) {
    std::vector<MapFollower::Delta> arriving = deltas;
    arriving.insert(arriving.end(), deltas.begin(), deltas.begin() + 7);
    std::shuffle(arriving.begin(), arriving.end(), std::mt19937(seed));
    MapFollower follower;
    Map replica;
    for (const auto& delta : arriving) {
      follower.Receive(delta);
      EXPECT_EQ(Update(follower, replica), "");
    }
    EXPECT_FALSE(follower.Request());
    ExpectEqual(replica, owner.map());
  }
}

TEST(MapFollower, AsksForAShortGapAndGetsTheDeltas) {
  Owner owner(2);
  MapFollower follower;
  Map replica;
  for (int i = 0; i < 20; ++i) {
    const auto delta = owner.Next();
    if (i < 10 || i > 12) follower.Receive(delta);
    EXPECT_EQ(Update(follower, replica), "");
    EXPECT_EQ(follower.Request().has_value(), i > 12);
  }
  EXPECT_EQ(replica.next_delta(), 10);
  owner.Answer(*follower.Request(), follower);
  EXPECT_EQ(Update(follower, replica), "");
  EXPECT_FALSE(follower.Request());
  EXPECT_EQ(owner.num_pages(), 0) << "no snapshot is needed";
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, AsksForALostTailWhenToldOfIt) {
  Owner owner(9);
  MapFollower follower;
  Map replica;
  for (int i = 0; i < 5; ++i) {
    const auto delta = owner.Next();
    if (i < 3) follower.Receive(delta);
  }
  EXPECT_EQ(Update(follower, replica), "");
  EXPECT_FALSE(follower.Request());
  follower.Expect(5);
  owner.Answer(follower.Request().value(), follower);
  EXPECT_EQ(Update(follower, replica), "");
  EXPECT_FALSE(follower.Request());
  ExpectEqual(replica, owner.map());
}

// Joins after `num_before` deltas; the owner goes on between any two answers.
void JoinLate(int num_before, bool hears_deltas) {
  Owner owner(3);
  for (int i = 0; i < num_before; ++i) owner.Next();
  MapFollower follower(true);
  Map replica;
  int num_rounds = 0;
  for (; follower.Request() && num_rounds < 1000; ++num_rounds) {
    owner.Answer(*follower.Request(), follower);
    const auto delta = num_rounds < 100 ? owner.Next() : nullptr;
    if (delta != nullptr && hears_deltas) follower.Receive(delta);
    EXPECT_EQ(Update(follower, replica), "");
  }
  EXPECT_LT(num_rounds, 1000);
  EXPECT_GT(owner.num_pages(), 3);
  for (int i = 0; i < 5; ++i) {
    follower.Receive(owner.Next());
    while (follower.Request()) {
      owner.Answer(*follower.Request(), follower);
      EXPECT_EQ(Update(follower, replica), "");
    }
    EXPECT_EQ(Update(follower, replica), "");
  }
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, WhoComesLateGetsASnapshotAndGoesOn) {
  for (const int num_before : {17, 50, 120}) {
    JoinLate(num_before, true);
    JoinLate(num_before, false);
  }
}

TEST(MapFollower, WhoComesLateToAYoungMapGetsItsDeltas) {
  Owner owner(4);
  MapFollower follower(true);
  Map replica;
  owner.Answer(*follower.Request(), follower);
  EXPECT_TRUE(follower.Request()) << "there is no map yet";
  for (int i = 0; i < 3; ++i) owner.Next();
  owner.Answer(*follower.Request(), follower);
  EXPECT_EQ(Update(follower, replica), "");
  EXPECT_FALSE(follower.Request());
  EXPECT_EQ(owner.num_pages(), 0);
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, AWrongHashIsFoundAndMendedByASnapshot) {
  Owner owner(5);
  MapFollower follower;
  Map replica;
  for (int i = 0; i < 40; ++i) {
    auto delta = owner.Next();
    if (i == 20) {
      auto wrong = std::make_shared<MapDelta>(*delta);
      wrong->changed_landmarks[0].landmark.position_in_world.x() += 1e-12;
      delta = wrong;
    }
    follower.Receive(delta);
    const std::string problem = Update(follower, replica);
    EXPECT_EQ(problem.find("wrong hash") != std::string::npos, i == 20) << problem;
    EXPECT_EQ(follower.needs_snapshot(), i >= 20 && i <= 22);
    if (i < 22) continue;
    while (follower.Request()) {
      owner.Answer(*follower.Request(), follower);
      EXPECT_EQ(Update(follower, replica), "");
    }
  }
  EXPECT_GT(owner.num_pages(), 1);
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, PagesForOthersAreNoBusinessOfOnesOwn) {
  Owner owner(6);
  MapFollower follower, late(true);
  Map replica;
  for (int i = 0; i < 20; ++i) follower.Receive(owner.Next());
  EXPECT_EQ(Update(follower, replica), "");
  while (late.Request()) {
    owner.Answer(*late.Request(), late);
    follower.Receive(CutSnapshotPage(owner.map().Snapshot(), 0));
  }
  EXPECT_TRUE(follower.Take().empty());
  ExpectEqual(replica, owner.map());
}

TEST(MapArchive, SeveralFollowersMayReadDifferentSnapshots) {
  Owner owner(7);
  for (int i = 0; i < 40; ++i) owner.Next();
  std::vector<MapFollower> followers(4, MapFollower(true));
  std::vector<Map> replicas(4);
  for (int round = 0; round < 2000; ++round) {
    const auto i = static_cast<size_t>(round % 4);
    if (round < 30) owner.Next();  // each begins at another time
    if (const auto request = followers[i].Request()) owner.Answer(*request, followers[i]);
    EXPECT_EQ(Update(followers[i], replicas[i]), "");
  }
  const auto last = owner.Next();
  for (size_t i = 0; i < followers.size(); ++i) {
    followers[i].Receive(last);
    while (followers[i].Request()) {
      owner.Answer(*followers[i].Request(), followers[i]);
      EXPECT_EQ(Update(followers[i], replicas[i]), "");
    }
    EXPECT_EQ(Update(followers[i], replicas[i]), "");
    ExpectEqual(replicas[i], owner.map());
  }
}

TEST(RemovedKeyframes, KeepTheirPlaceAcrossASnapshot) {
  Owner owner(8);
  RemovedKeyframes removed;
  Map replica;
  for (int i = 0; i < 4; ++i) {
    const auto delta = owner.Next();
    removed.Remember(replica, *delta);
    ASSERT_EQ(replica.Apply(*delta), "");
  }
  owner.Next();  // takes keyframe 1 away, and is missed
  const MapDelta snapshot = owner.map().Snapshot();
  removed.Remember(replica, snapshot);
  ASSERT_EQ(replica.Apply(snapshot), "");
  EXPECT_EQ(replica.FindKeyframe({1}), nullptr);
  EXPECT_EQ(removed.Successor(replica, {1}), KeyframeId{0});
  EXPECT_TRUE(removed.Find(replica, {1}).has_value());
}

}  // namespace
}  // namespace tessera
