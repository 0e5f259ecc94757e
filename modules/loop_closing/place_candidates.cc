#include "loop_closing/place_candidates.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "core/id_set.h"
#include "map/neighborhood.h"

namespace tessera {
namespace {

struct Group {
  double score = 0.0;  // of all its keyframes that look alike
  KeyframeId best;     // of them
};

// Neighboring keyframes look alike, so their scores are added: a place of which only one image matches is weak. Best
// group first, each named by its best keyframe (if equal, as a camera at rest makes them, the oldest); groups
// with the same best keyframe are one.
std::vector<Group> RankGroups(const Map& map, const std::vector<PlaceDatabase::Place>& found,
                              const CandidateOptions& options) {
  std::map<KeyframeId, double> score_of;
  for (const PlaceDatabase::Place& place : found) score_of[place.id] = place.score;
  std::vector<Group> groups;
  for (const PlaceDatabase::Place& place : found) {
    Group group{0.0, place.id};
    double best_score = place.score;
    for (const KeyframeId id : KeyframesAround(map, place.id, options.num_neighbors)) {
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

// The keyframe, its neighbors and theirs.
IdSet<KeyframeId> Connected(const Map& map, KeyframeId id, int min_shared) {
  IdSet<KeyframeId> connected(map.keyframes().end_id());
  connected.Add(id);
  for (const auto& [neighbor, num_shared] : map.FindKeyframe(id)->covisible) {
    if (num_shared < min_shared) continue;
    connected.Add(neighbor);
    for (const auto& [second, num_with_second] : map.FindKeyframe(neighbor)->covisible) {
      if (num_with_second >= min_shared) connected.Add(second);
    }
  }
  return connected;
}

// The lowest similarity of a neighbor with the keyframe.
double LowestNeighborScore(const Map& map, const PlaceDatabase& places, KeyframeId id,
                           const CandidateOptions& options) {
  const BagOfWords* bag = places.Find(id);
  double lowest = 1.0;
  for (const KeyframeId neighbor : map.Covisible(id, options.num_neighbors, options.min_shared_landmarks)) {
    if (const BagOfWords* other = places.Find(neighbor)) lowest = std::min(lowest, Similarity(*bag, *other));
  }
  return lowest;
}

std::vector<Group> FindGroups(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options) {
  const BagOfWords* bag = places.Find(id);
  if (bag == nullptr) return {};
  const IdSet<KeyframeId> connected = Connected(map, id, options.min_shared_landmarks);
  std::vector<PlaceDatabase::Place> found =
      places.Query(*bag, [&](KeyframeId other) { return other < id && !connected.Has(other); });
  const double min_score = LowestNeighborScore(map, places, id, options);
  std::erase_if(found, [&](const PlaceDatabase::Place& place) { return place.score < min_score; });
  if (found.empty()) return {};
  return RankGroups(map, found, options);
}

// The newest of the neighbors of `id` that are older than it.
std::vector<KeyframeId> PreviousNeighbors(const Map& map, KeyframeId id, const CandidateOptions& options) {
  std::vector<KeyframeId> previous =
      map.Covisible(id, static_cast<int>(map.keyframes().size()), options.min_shared_landmarks);
  std::erase_if(previous, [&](KeyframeId other) { return other > id; });
  std::sort(previous.begin(), previous.end(), std::greater<>());
  previous.resize(std::min(previous.size(), static_cast<size_t>(options.num_consistent)));
  return previous;
}

// By keyframe: all keyframes of its candidate places.
std::vector<std::set<KeyframeId>> PlacesOf(const Map& map, const PlaceDatabase& places,
                                           const std::vector<KeyframeId>& keyframes, const CandidateOptions& options) {
  std::vector<std::set<KeyframeId>> places_of;
  for (const KeyframeId id : keyframes) {
    std::set<KeyframeId>& members = places_of.emplace_back();
    for (const Group& group : FindGroups(map, places, id, options)) {
      const std::vector<KeyframeId> place = KeyframesAround(map, group.best, options.num_neighbors);
      members.insert(place.begin(), place.end());
    }
  }
  return places_of;
}

}  // namespace

Result<> CandidateOptions::Check() const {
  if (min_shared_landmarks < 1 || num_neighbors < 1 || num_consistent < 0 || max_candidates < 1) {
    return Failed("the numbers of neighbors and candidates must be positive");
  }
  return {};
}

Candidates FindLoopCandidates(const Map& map, const PlaceDatabase& places, KeyframeId id,
                              const CandidateOptions& options) {
  Candidates candidates;
  const std::vector<Group> groups = FindGroups(map, places, id, options);
  candidates.num_found = static_cast<int>(groups.size());
  if (groups.empty()) return candidates;
  const std::vector<KeyframeId> previous = PreviousNeighbors(map, id, options);
  if (static_cast<int>(previous.size()) < options.num_consistent) return candidates;
  const std::vector<std::set<KeyframeId>> previous_places = PlacesOf(map, places, previous, options);
  for (const Group& group : groups) {
    const std::vector<KeyframeId> place = KeyframesAround(map, group.best, options.num_neighbors);
    const auto meets = [&](const std::set<KeyframeId>& members) {
      return std::any_of(place.begin(), place.end(), [&](KeyframeId member) { return members.contains(member); });
    };
    if (std::all_of(previous_places.begin(), previous_places.end(), meets) &&
        static_cast<int>(candidates.keyframes.size()) < options.max_candidates) {
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
