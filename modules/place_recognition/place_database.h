// The bags of words of all keyframes, with an inverted index: word -> keyframes that hold it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "core/ids.h"
#include "place_recognition/bag_of_words.h"

namespace tessera {

// Answers depend on which keyframes are in it, not on the order in which they came and went.
class PlaceDatabase {
 public:
  struct Place {
    KeyframeId id;
    int32_t num_common_words = 0;
    double score = 0.0;  // Similarity with the query

    bool operator==(const Place&) const = default;
  };

  // Throws std::invalid_argument if there is a bag of this keyframe already.
  void Add(KeyframeId id, std::shared_ptr<const BagOfWords> bag);
  // Does nothing if there is none.
  void Remove(KeyframeId id);
  // nullptr if there is none. Valid until the keyframe is removed.
  const BagOfWords* Find(KeyframeId id) const;
  size_t size() const { return slot_of_keyframe_.size(); }

  // Of the keyframes that share a word with `bag` and that `accepts`, those that share at least `min_common_share` of
  // the largest number of words that any of them shares; best score first, ties by id.
  std::vector<Place> Query(const BagOfWords& bag, const std::function<bool(KeyframeId)>& accepts,
                           double min_common_share = 0.8) const;

 private:
  struct Slot {
    KeyframeId id;  // invalid: free
    std::shared_ptr<const BagOfWords> bag;
  };
  struct Occurrence {
    int32_t slot;
    float weight;
  };

  // Places by slot, those that share no word with num_common_words = 0.
  std::vector<Place> CountCommonWords(const BagOfWords& bag) const;

  std::map<KeyframeId, int32_t> slot_of_keyframe_;
  std::vector<Slot> slots_;
  std::vector<int32_t> free_slots_;
  std::vector<std::vector<Occurrence>> occurrences_;  // by word; in no order
};

}  // namespace tessera
