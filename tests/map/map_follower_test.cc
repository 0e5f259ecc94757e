#include "map/map_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <random>
#include <set>

#include "map/map_archive.h"
#include "map/removed_keyframes.h"
#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

// The owner of a map that changes at random.
class Owner {
 public:
  explicit Owner(unsigned seed) : generator_(seed) {}
  // Begins with a map of so many deltas, loaded from its snapshot.
  Owner(unsigned seed, int num_loaded) : generator_(seed) {
    Map made;
    for (int i = 0; i < num_loaded; ++i) RandomChange(made, generator_);
    EXPECT_THAT(map_.Apply(made.Snapshot()), IsSuccess());
    archive_.Begin(map_);
  }

  MapFollower::Delta Next(std::optional<int64_t> awaited = std::nullopt) {
    auto delta = std::make_shared<const MapDelta>(RandomChange(map_, generator_));
    archive_.Add(delta, awaited);
    return delta;
  }
  MapArchive::Answer AnswerTo(const MapRequest& request) { return archive_.AnswerTo(request); }
  void Answer(const MapRequest& request, MapFollower& follower) {
    const MapArchive::Answer answer = AnswerTo(request);
    num_pages_ += static_cast<int>(answer.pages.size());
    for (const auto& delta : answer.deltas) follower.Receive(delta);
    for (const MapSnapshotPage& page : answer.pages) follower.Receive(page);
  }
  const Map& map() const { return map_; }
  int num_pages() const { return num_pages_; }

 private:
  std::mt19937 generator_;
  Map map_;
  MapArchive archive_;
  int num_pages_ = 0;
};

// Applies what can be applied.
Result<> Update(MapFollower& follower, Map& replica) {
  for (const auto& delta : follower.Take()) {
    if (const Result<> applied = replica.Apply(*delta); !applied) {
      follower.Reject();
      return applied;
    }
  }
  return {};
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
      EXPECT_THAT(Update(follower, replica), IsSuccess());
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
    EXPECT_THAT(Update(follower, replica), IsSuccess());
    EXPECT_EQ(follower.Request().has_value(), i > 12);
  }
  EXPECT_EQ(replica.next_delta(), 10);
  owner.Answer(*follower.Request(), follower);
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_FALSE(follower.Request());
  EXPECT_EQ(owner.num_pages(), 0) << "no snapshot is needed";
  ExpectEqual(replica, owner.map());
}

// A global adjustment of a large map took so long that 880 deltas passed by the adjuster's receive buffer.
TEST(MapFollower, AGapIsClosedHoweverMuchCameBehindIt) {
  Owner owner(3);
  MapFollower follower;
  Map replica;
  std::vector<MapFollower::Delta> deltas;
  for (int i = 0; i < 400; ++i) deltas.push_back(owner.Next(5));
  for (int i = 5; i < 400; ++i) follower.Receive(deltas[static_cast<size_t>(i)]);
  EXPECT_THAT(follower.Take(), testing::IsEmpty());
  for (int i = 0; i < 50 && replica.next_delta() < owner.map().next_delta(); ++i) {
    follower.Expect(400);
    const std::optional<MapRequest> request = follower.TakeRequest();
    ASSERT_TRUE(request.has_value());
    owner.Answer(*request, follower);
    ASSERT_THAT(Update(follower, replica), IsSuccess());
  }
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
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_FALSE(follower.Request());
  follower.Expect(5);
  owner.Answer(follower.Request().value(), follower);
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_FALSE(follower.Request());
  ExpectEqual(replica, owner.map());
}

// A page at a time, a large map would come at the pace of questions and answers.
TEST(MapFollower, PagesComeSeveralForEachQuestion) {
  Owner owner(3);
  for (int i = 0; i < 150; ++i) owner.Next();
  MapFollower follower(true);
  Map replica;
  int num_questions = 0, num_pages = 0;
  while (const std::optional<MapRequest> request = follower.TakeRequest()) {
    ASSERT_LT(++num_questions, 100);
    for (const MapSnapshotPage& page : owner.AnswerTo(*request).pages) {
      EXPECT_EQ(page.page, num_pages++);
      if (num_pages % MapRequest::kMaxPages != 1) {
        EXPECT_FALSE(follower.TakeRequest().has_value()) << "the page is on its way";
      }
      follower.Receive(page);
    }
    if (!follower.BegunSnapshot() && follower.next_delta() > 0) break;
  }
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_GT(num_pages, 2 * MapRequest::kMaxPages);
  EXPECT_EQ(num_questions, 1 + (num_pages - 1 + MapRequest::kMaxPages - 1) / MapRequest::kMaxPages);
}

// Whoever has the snapshot elsewhere is done with its first page.
TEST(MapFollower, TakesTheRestOfASnapshotFromElsewhere) {
  Owner owner(3);
  for (int i = 0; i < 100; ++i) owner.Next();
  MapFollower follower(true);
  EXPECT_EQ(follower.BegunSnapshot(), nullptr);
  const MapSnapshotPage first = owner.AnswerTo(*follower.Request()).pages.front();
  ASSERT_GT(first.num_pages, 2);
  follower.Receive(first);
  ASSERT_NE(follower.BegunSnapshot(), nullptr);
  EXPECT_EQ(follower.BegunSnapshot()->hash, first.part.hash);
  MapDelta whole;
  for (int32_t page = 0; page < first.num_pages; ++page) {
    const MapArchive::Answer answer = owner.AnswerTo({.snapshot = first.part.number, .page = page});
    if (page == 0) whole = answer.pages.front().part;
    if (page > 0) AppendPage(answer.pages.front(), &whole);
  }
  follower.ReceiveRest(whole);
  EXPECT_EQ(follower.BegunSnapshot(), nullptr);
  Map replica;
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_EQ(replica.next_delta(), first.part.number + 1);
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
    EXPECT_THAT(Update(follower, replica), IsSuccess());
  }
  EXPECT_LT(num_rounds, 1000);
  EXPECT_GT(owner.num_pages(), 3);
  for (int i = 0; i < 5; ++i) {
    follower.Receive(owner.Next());
    while (follower.Request()) {
      owner.Answer(*follower.Request(), follower);
      EXPECT_THAT(Update(follower, replica), IsSuccess());
    }
    EXPECT_THAT(Update(follower, replica), IsSuccess());
  }
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, WhoComesLateGetsASnapshotAndGoesOn) {
  for (const int num_before : {100, 143, 200}) {
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
  for (int i = 0; i < 40; ++i) owner.Next();
  owner.Answer(*follower.Request(), follower);
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  EXPECT_EQ(replica.next_delta(), MapRequest::kMaxDeltas);
  follower.Expect(40);
  while (follower.Request()) {
    owner.Answer(*follower.Request(), follower);
    EXPECT_THAT(Update(follower, replica), IsSuccess());
  }
  EXPECT_EQ(owner.num_pages(), 0);
  ExpectEqual(replica, owner.map());
}

// The owner goes on while a late follower catches up, and every delta is heard the moment it is sent.
TEST(MapFollower, AsksOnceForAllDeltasOfAnAnswer) {
  Owner owner(13);
  std::deque<MapFollower::Delta> on_their_way;
  for (int i = 0; i < 40; ++i) owner.Next();
  MapFollower follower(true);
  Map replica;
  int num_requests = 0, num_sent = 0;
  for (int round = 0; round < 1000 && (round < 30 || !on_their_way.empty()); ++round) {
    if (const auto request = follower.TakeRequest()) {
      ++num_requests;
      for (const auto& delta : owner.AnswerTo(*request).deltas) on_their_way.push_back(delta);
    }
    if (round % 5 == 0 && round < 30) on_their_way.push_back(owner.Next());
    if (on_their_way.empty()) continue;
    ++num_sent;
    follower.Receive(on_their_way.front());
    on_their_way.pop_front();
    EXPECT_THAT(Update(follower, replica), IsSuccess());
  }
  ExpectEqual(replica, owner.map());
  EXPECT_LE(num_requests, 5);
  EXPECT_LE(num_sent, 80) << "46 deltas were made";
}

TEST(MapFollower, AsksAgainIfNoAnswerComes) {
  MapFollower follower(true);
  const auto request = follower.TakeRequest();
  ASSERT_TRUE(request.has_value());
  EXPECT_FALSE(follower.TakeRequest());
  follower.ForgetRequest();
  EXPECT_EQ(follower.TakeRequest(), request);
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
    const Result<> updated = Update(follower, replica);
    EXPECT_EQ(testing::Value(updated, IsFailure(HasSubstr("wrong hash"))), i == 20);
    EXPECT_EQ(follower.needs_snapshot(), i >= 20 && i <= 22);
    if (i < 22) continue;
    while (follower.Request()) {
      owner.Answer(*follower.Request(), follower);
      EXPECT_THAT(Update(follower, replica), IsSuccess());
    }
  }
  EXPECT_GT(owner.num_pages(), 1);
  ExpectEqual(replica, owner.map());
}

// Who finds late that a delta was wrong has dropped those behind it, and the owner may wait for that one itself.
TEST(MapFollower, AfterAWrongHashWhatTheSnapshotLacksIsAskedForWithoutNews) {
  Owner owner(5);
  MapFollower follower;
  std::vector<MapFollower::Delta> given;
  for (int i = 0; i < 40; ++i) {
    follower.Receive(owner.Next());
    std::ranges::move(follower.Take(), std::back_inserter(given));
  }
  ASSERT_EQ(given.size(), 40U);
  follower.Reject();
  Map replica;
  while (follower.Request()) {
    owner.Answer(*follower.Request(), follower);
    EXPECT_THAT(Update(follower, replica), IsSuccess());
  }
  ASSERT_GT(owner.num_pages(), 0);
  ExpectEqual(replica, owner.map());
}

TEST(MapFollower, PagesForOthersAreNoBusinessOfOnesOwn) {
  Owner owner(6);
  MapFollower follower, late(true);
  Map replica;
  for (int i = 0; i < 20; ++i) follower.Receive(owner.Next());
  EXPECT_THAT(Update(follower, replica), IsSuccess());
  while (late.Request()) {
    owner.Answer(*late.Request(), late);
    follower.Receive(CutSnapshotPage(owner.map().Snapshot(), 0));
  }
  EXPECT_TRUE(follower.Take().empty());
  ExpectEqual(replica, owner.map());
}

TEST(MapArchive, SeveralFollowersMayReadDifferentSnapshots) {
  Owner owner(7);
  for (int i = 0; i < 130; ++i) owner.Next();
  std::vector<MapFollower> followers(4, MapFollower(true));
  std::vector<Map> replicas(4);
  std::set<int64_t> read;
  for (int round = 0; round < 200; ++round) {
    for (int i = 0; i < 20 && round < 20; ++i) owner.Next();
    for (size_t i = 0; i < followers.size(); ++i) {
      if (round < 5 * static_cast<int>(i)) continue;  // each begins at another time
      if (const auto request = followers[i].Request()) {
        if (request->snapshot >= 0) read.insert(request->snapshot);
        owner.Answer(*request, followers[i]);
      }
      EXPECT_THAT(Update(followers[i], replicas[i]), IsSuccess());
    }
  }
  EXPECT_GE(read.size(), 3U);
  const auto last = owner.Next();
  for (size_t i = 0; i < followers.size(); ++i) {
    followers[i].Receive(last);
    while (followers[i].Request()) {
      owner.Answer(*followers[i].Request(), followers[i]);
      EXPECT_THAT(Update(followers[i], replicas[i]), IsSuccess());
    }
    EXPECT_THAT(Update(followers[i], replicas[i]), IsSuccess());
    ExpectEqual(replicas[i], owner.map());
  }
}

// Who begins with the base snapshot finds all that the mapper may still wait for in the deltas since: it repeats
// everything that another one did on the map as it was then.
void ExpectOldBaseWithAllDeltasSince(Owner& owner, int64_t num_since_begin) {
  const std::vector<MapSnapshotPage> pages = owner.AnswerTo({}).pages;
  ASSERT_THAT(pages, testing::SizeIs(1));
  const int64_t next = owner.map().next_delta();
  const int64_t age = next - 1 - pages[0].part.number;
  EXPECT_GE(age, std::min(num_since_begin, MapArchive::kDelay)) << next;
  EXPECT_LE(age, 2 * MapArchive::kDelay) << next;
  for (int64_t number = pages[0].part.number + 1; number < next;) {
    const MapArchive::Answer answer = owner.AnswerTo({.next_delta = number});
    ASSERT_THAT(answer.pages, testing::IsEmpty()) << "delta " << number << " of " << next << " is gone";
    ASSERT_FALSE(answer.deltas.empty());
    for (const auto& delta : answer.deltas) EXPECT_EQ(delta->number, number++);
  }
}

TEST(MapArchive, TheBaseSnapshotIsOldAndAllDeltasSinceAreThere) {
  Owner owner(10);
  for (int64_t i = 0; i < 200; ++i) {
    owner.Next();
    ExpectOldBaseWithAllDeltasSince(owner, i);
  }
}

TEST(MapArchive, TheBaseSnapshotIsOlderThanWhatIsAwaited) {
  Owner owner(12);
  for (int64_t i = 0; i < 60; ++i) owner.Next();
  for (int64_t i = 0; i < 300; ++i) owner.Next(60);
  const std::vector<MapSnapshotPage> pages = owner.AnswerTo({}).pages;
  ASSERT_THAT(pages, testing::SizeIs(1));
  EXPECT_LT(pages[0].part.number, 60);
  EXPECT_GE(pages[0].part.number, 60 - 2 * MapArchive::kDelay);
  EXPECT_THAT(owner.AnswerTo({.next_delta = 60}).pages, testing::IsEmpty()) << "the awaited delta itself is gone";
  for (int64_t i = 0; i < MapArchive::kDelay; ++i) owner.Next();
  ExpectOldBaseWithAllDeltasSince(owner, 300);
}

TEST(MapArchive, ASnapshotStaysAsLongAsItIsRead) {
  Owner owner(13);
  for (int64_t i = 0; i < 200; ++i) owner.Next();
  const MapSnapshotPage first = owner.AnswerTo({}).pages.at(0);
  ASSERT_GT(first.num_pages, 20);
  for (int32_t page = 1; page < first.num_pages; ++page) {  // a slow reader
    for (int64_t i = 0; i < MapArchive::kDelay / 4; ++i) owner.Next();
    EXPECT_EQ(owner.AnswerTo({.snapshot = first.part.number, .page = page}).pages.at(0).page, page);
  }
  EXPECT_THAT(owner.AnswerTo({.next_delta = first.part.number + 1}).pages, testing::IsEmpty());
  for (int64_t i = 0; i < 2 * MapArchive::kDelay; ++i) owner.Next();
  const MapSnapshotPage renewed = owner.AnswerTo({.snapshot = first.part.number, .page = 1}).pages.at(0);
  EXPECT_EQ(renewed.page, 0) << "nobody reads it any more";
  EXPECT_GT(renewed.part.number, first.part.number);
}

TEST(MapArchive, BeginsWithALoadedMap) {
  for (const int num_loaded : {1, 46, 60}) {
    Owner owner(11, num_loaded);
    const MapArchive::Answer answer = owner.AnswerTo({.next_delta = 0});
    ASSERT_THAT(answer.pages, testing::SizeIs(1)) << "nobody has the deltas that made it";
    EXPECT_EQ(answer.pages[0].part.number, num_loaded - 1);
    for (int64_t i = 1; i < 120; ++i) {
      owner.Next();
      ExpectOldBaseWithAllDeltasSince(owner, i);
    }
    MapFollower late(true);
    Map replica;
    while (late.Request()) {
      owner.Answer(*late.Request(), late);
      late.Expect(owner.map().next_delta());
      EXPECT_THAT(Update(late, replica), IsSuccess());
    }
    ExpectEqual(replica, owner.map());
  }
}

TEST(RemovedKeyframes, KeepTheirPlaceAcrossASnapshot) {
  Owner owner(8);
  RemovedKeyframes removed;
  Map replica;
  for (int i = 0; i < 4; ++i) {
    const auto delta = owner.Next();
    removed.Remember(replica, *delta);
    ASSERT_THAT(replica.Apply(*delta), IsSuccess());
  }
  owner.Next();  // takes keyframe 1 away, and is missed
  const MapDelta snapshot = owner.map().Snapshot();
  removed.Remember(replica, snapshot);
  ASSERT_THAT(replica.Apply(snapshot), IsSuccess());
  EXPECT_EQ(replica.FindKeyframe({1}), nullptr);
  EXPECT_EQ(removed.Successor(replica, {1}), KeyframeId{0});
  EXPECT_TRUE(removed.Find(replica, {1}).has_value());
}

}  // namespace
}  // namespace tessera
