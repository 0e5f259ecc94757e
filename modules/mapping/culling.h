// What the map does without: landmarks that proved unreliable, keyframes that say nothing new.
#pragma once

#include <string>
#include <vector>

#include "map/map_editor.h"
#include "map/removed_keyframes.h"

namespace tessera {

struct CullingOptions {
  int trial_keyframes = 3;       // a landmark is on trial while so many further keyframes come
  int min_observations = 3;      // that it must have by the end of it (the first ones count)
  int num_witnesses = 10;        // keyframes next to the newest that are asked whether they see a new landmark
  double min_seen_share = 0.3;   // of those that should see it: corners are found again in about half of the images
  double redundant_share = 0.9;  // of a keyframe's landmarks ...
  int redundant_observers = 3;   // ... seen by so many others on the same level or a finer one: it is redundant
  int kept_newest = 3;           // the newest keyframes stay: neighbours of theirs are yet to come

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

// Landmarks on trial: born at a keyframe, and not yet seen often enough to be trusted.
class LandmarkTrial {
 public:
  void Add(KeyframeId born, const std::vector<LandmarkId>& landmarks);
  // Removes those that failed by the time of keyframe `now`.
  void Judge(KeyframeId now, const CullingOptions& options, MapEditor& editor);

 private:
  struct Entry {
    LandmarkId landmark;
    KeyframeId born;
  };
  std::vector<Entry> entries_;  // by age
};

// Removes those of the landmarks just made that too few of the keyframes around `center` see, of those that should by
// their pose: chance pairs, mostly. To be called when duplicates have been fused.
void RemoveUnconfirmed(KeyframeId center, const std::vector<LandmarkId>& created, const CullingOptions& options,
                       MapEditor& editor);

// Removes the redundant ones among the keyframes that share landmarks with `center`; their children pass to their
// parents, and `removed` remembers where they stood. Roots stay, and so do keyframes that closed a loop.
void CullKeyframes(KeyframeId center, const CullingOptions& options, RemovedKeyframes& removed, MapEditor& editor);

}  // namespace tessera
