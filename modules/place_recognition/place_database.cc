#include "place_recognition/place_database.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace tessera {

void PlaceDatabase::Add(KeyframeId id, std::shared_ptr<const BagOfWords> bag) {
  if (slot_of_keyframe_.contains(id)) {
    throw std::invalid_argument("keyframe " + std::to_string(id.value) + " is in the place database already");
  }
  if (free_slots_.empty()) {
    free_slots_.push_back(static_cast<int32_t>(slots_.size()));
    slots_.emplace_back();
  }
  const int32_t slot = free_slots_.back();
  free_slots_.pop_back();
  for (const auto& [word, weight] : bag->words) {
    const auto index = static_cast<size_t>(word);
    if (index >= occurrences_.size()) occurrences_.resize(index + 1);
    occurrences_[index].push_back({slot, weight});
  }
  slots_[static_cast<size_t>(slot)] = {id, std::move(bag)};
  slot_of_keyframe_[id] = slot;
}

void PlaceDatabase::Remove(KeyframeId id) {
  const auto found = slot_of_keyframe_.find(id);
  if (found == slot_of_keyframe_.end()) return;
  const int32_t slot = found->second;
  for (const auto& [word, weight] : slots_[static_cast<size_t>(slot)].bag->words) {
    std::erase_if(occurrences_[static_cast<size_t>(word)],
                  [&](const Occurrence& occurrence) { return occurrence.slot == slot; });
  }
  slots_[static_cast<size_t>(slot)] = {};
  free_slots_.push_back(slot);
  slot_of_keyframe_.erase(found);
}

const BagOfWords* PlaceDatabase::Find(KeyframeId id) const {
  const auto found = slot_of_keyframe_.find(id);
  return found == slot_of_keyframe_.end() ? nullptr : slots_[static_cast<size_t>(found->second)].bag.get();
}

std::vector<PlaceDatabase::Place> PlaceDatabase::CountCommonWords(const BagOfWords& bag) const {
  std::vector<Place> places(slots_.size());
  for (const auto& [word, weight] : bag.words) {
    if (static_cast<size_t>(word) >= occurrences_.size()) break;  // words ascend
    for (const Occurrence& occurrence : occurrences_[static_cast<size_t>(word)]) {
      Place& place = places[static_cast<size_t>(occurrence.slot)];
      ++place.num_common_words;
      // Each keyframe's sum grows in the order of the words, as in Similarity: the same to the last bit.
      place.score += static_cast<double>(std::min(weight, occurrence.weight));
    }
  }
  return places;
}

std::vector<PlaceDatabase::Place> PlaceDatabase::Query(const BagOfWords& bag,
                                                       const std::function<bool(KeyframeId)>& accepts,
                                                       double min_common_share) const {
  std::vector<Place> found;
  int32_t most_common = 0;
  const std::vector<Place> places = CountCommonWords(bag);
  for (size_t slot = 0; slot < places.size(); ++slot) {
    if (places[slot].num_common_words == 0 || !accepts(slots_[slot].id)) continue;
    found.push_back({slots_[slot].id, places[slot].num_common_words, std::min(places[slot].score, 1.0)});
    most_common = std::max(most_common, places[slot].num_common_words);
  }
  std::erase_if(found, [&](const Place& place) {
    return static_cast<double>(place.num_common_words) < min_common_share * static_cast<double>(most_common);
  });
  std::sort(found.begin(), found.end(),
            [](const Place& a, const Place& b) { return a.score != b.score ? a.score > b.score : a.id < b.id; });
  return found;
}

}  // namespace tessera
