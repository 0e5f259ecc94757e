// Landmark culling: landmarks that prove unreliable soon after their creation leave the map.
#pragma once

#include <vector>

#include "core/result.h"
#include "map/map_editor.h"

namespace tessera {

struct LandmarkCullingOptions {
  int recent_keyframes = 3;     // a landmark is recent until so many further keyframes have come
  int min_observations = 3;     // that it must have by then, those of its creation included
  int num_checked_views = 10;   // keyframes around the newest that are checked for a view of a new landmark
  double min_seen_share = 0.3;  // of those that should see it: corners are found again in about half of the images

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Landmarks created lately, which must yet show that they are found again (the recent map points of Mur-Artal et al.,
// "ORB-SLAM", 2015).
class RecentLandmarks {
 public:
  void Add(KeyframeId created_at, const std::vector<LandmarkId>& landmarks);
  // Removes those from the map that have too few observations by the time of keyframe `now`; those that are old enough
  // are trusted from now on.
  void Cull(KeyframeId now, const LandmarkCullingOptions& options, MapEditor& editor);
  // The same where Cull's changes are in the map already.
  void ForgetOld(KeyframeId now, const LandmarkCullingOptions& options, const Map& map);

 private:
  struct Entry {
    LandmarkId landmark;
    KeyframeId created_at;
  };
  std::vector<Entry> entries_;  // by age
};

// Removes those of the landmarks just created that too few keyframes around `center` observe, of those that should by
// their pose: mostly chance pairs. The two keyframes that made a landmark don't count, on either side: they were chosen
// because they agree. To be called after duplicates have been fused.
void RemoveUnconfirmed(KeyframeId center, const std::vector<LandmarkId>& created, const LandmarkCullingOptions& options,
                       MapEditor& editor);

}  // namespace tessera
