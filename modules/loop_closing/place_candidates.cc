#include "loop_closing/place_candidates.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "map/neighbourhood.h"

namespace tessera {
namespace {

struct Group {
  double score = 0.0;  // of all its keyframes that look alike
  KeyframeId best;     // of them
};

// Neighbouring keyframes look alike, so their scores are added: a place that only one image of speaks for is weak. Best
// group first, each named by its best keyframe (of equals, which a camera that stands still makes, the oldest); groups
// with the same best keyframe are one.
std::vector<Group> RankGroups(const Map& map, const std::vector<PlaceDatabase::Place>& found,
                              const CandidateOptions& options) {
  std::map<KeyframeId, double> score_of;
  for (const PlaceDatabase::Place& place : found) score_of[place.id] = place.score;
  std::vector<Group> groups;
  for (const PlaceDatabase::Place& place : found) {
    Group group{0.0, place.id};
    double best_score = place.score;
    for (const KeyframeId id : KeyframesAround(map, place.id, options.num_neighbours)) {
      const auto member = score_of.find(id);
      if (member == score_of.end()) continue;
      group.score += member->second;
      if (member->second > best_score || (member->second == best_score && id < group.best)) {
        best_score = member->second;
        group.best = id;
      }
    }
    groups.push_back(group);
  }
  std::sort(groups.begin(), groups.end(),
            [](const Group& a, const Group& b) { return a.score != b.score ? a.score > b.score : a.best < b.best; });
  std::set<KeyframeId> named;
  std::erase_if(groups, [&](const Group& group) {
    return group.score < options.min_group_share * groups.front().score || !named.insert(group.best).second;
  });
  return groups;
}

// The keyframe, its neighbours and theirs.
std::set<KeyframeId> Connected(const Map& map, KeyframeId id, int min_shared) {
  std::set<KeyframeId> connected{id};
  const auto num_all = static_cast<int>(map.keyframes().size());
  for (const KeyframeId neighbour : map.Covisible(id, num_all, min_shared)) {
    connected.insert(neighbour);
    for (const KeyframeId second : map.Covisible(neighbour, num_all, min_shared)) connected.insert(second);
  }
  return connected;
}

// The least that any neighbour looks like the keyframe.
double LowestNeighbourScore(const Map& map, const PlaceDatabase& places, KeyframeId id,
                            const CandidateOptions& options) {
  const BagOfWords* bag = places.Find(id);
  double lowest = 1.0;
  for (const KeyframeId neighbour : map.Covisible(id, options.num_neighbours, options.min_shared_landmarks)) {
    if (const BagOfWords* other = places.Find(neighbour)) lowest = std::min(lowest, Similarity(*bag, *other));
  }
  return lowest;
}

std::vector<Group> FindGroups(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options) {
  const BagOfWords* bag = places.Find(id);
  if (bag == nullptr) return {};
  const std::set<KeyframeId> connected = Connected(map, id, options.min_shared_landmarks);
  std::vector<PlaceDatabase::Place> found =
      places.Query(*bag, [&](KeyframeId other) { return other < id && !connected.contains(other); });
  const double min_score = LowestNeighbourScore(map, places, id, options);
  std::erase_if(found, [&](const PlaceDatabase::Place& place) { return place.score < min_score; });
  if (found.empty()) return {};
  return RankGroups(map, found, options);
}

// The keyframes made just before `id` that are neighbours of it.
std::vector<KeyframeId> Witnesses(const Map& map, KeyframeId id, const CandidateOptions& options) {
  std::vector<KeyframeId> witnesses =
      map.Covisible(id, static_cast<int>(map.keyframes().size()), options.min_shared_landmarks);
  std::erase_if(witnesses, [&](KeyframeId other) { return other > id; });
  std::sort(witnesses.begin(), witnesses.end(), std::greater<>());
  witnesses.resize(std::min(witnesses.size(), static_cast<size_t>(options.num_witnesses)));
  return witnesses;
}

}  // namespace

std::string CandidateOptions::Check() const {
  if (min_shared_landmarks < 1 || num_neighbours < 1 || num_witnesses < 0 || max_candidates < 1) {
    return "the loop closer's numbers of neighbours and candidates must be positive";
  }
  return "";
}

Candidates FindLoopCandidates(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options) {
  Candidates candidates;
  const std::vector<Group> groups = FindGroups(map, places, id, options);
  candidates.num_found = static_cast<int>(groups.size());
  if (groups.empty()) return candidates;
  const std::vector<KeyframeId> witnesses = Witnesses(map, id, options);
  if (static_cast<int>(witnesses.size()) < options.num_witnesses) return candidates;
  std::vector<std::set<KeyframeId>> seen_by;  // each witness's places
  for (const KeyframeId witness : witnesses) {
    std::set<KeyframeId>& seen = seen_by.emplace_back();
    for (const Group& group : FindGroups(map, places, witness, options)) {
      const std::vector<KeyframeId> place = KeyframesAround(map, group.best, options.num_neighbours);
      seen.insert(place.begin(), place.end());
    }
  }
  for (const Group& group : groups) {
    const std::vector<KeyframeId> place = KeyframesAround(map, group.best, options.num_neighbours);
    const bool is_confirmed = std::all_of(seen_by.begin(), seen_by.end(), [&](const std::set<KeyframeId>& seen) {
      return std::any_of(place.begin(), place.end(), [&](KeyframeId member) { return seen.contains(member); });
    });
    if (is_confirmed && static_cast<int>(candidates.keyframes.size()) < options.max_candidates) {
      candidates.keyframes.push_back(group.best);
    }
  }
  return candidates;
}

std::vector<KeyframeId> FindPlaces(const Map& map, const PlaceDatabase& places, const BagOfWords& bag,
                                   const CandidateOptions& options) {
  const std::vector<PlaceDatabase::Place> found =
      places.Query(bag, [&](KeyframeId id) { return map.FindKeyframe(id) != nullptr; });
  std::vector<KeyframeId> keyframes;
  if (found.empty()) return keyframes;
  for (const Group& group : RankGroups(map, found, options)) {
    if (static_cast<int>(keyframes.size()) < options.max_candidates) keyframes.push_back(group.best);
  }
  return keyframes;
}

}  // namespace tessera
