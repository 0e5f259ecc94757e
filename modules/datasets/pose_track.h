// A pose over time, known at single moments: the ground truth of data sets.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "geometry/rigid3.h"

namespace tessera {

class PoseTrack {
 public:
  // Of several poses at one time the first one counts.
  void Add(int64_t time_ns, const Rigid3& pose) { poses_.emplace(time_ns, pose); }

  // The pose at a time: linear between its neighbors in translation, slerp in rotation. nullopt outside the
  // track and where the neighbors are more than kMaxGapNs apart.
  std::optional<Rigid3> At(int64_t time_ns) const;

  // Motion capture and survey instruments give 100 poses a second or more; over a longer gap a straight line
  // would be a guess.
  static constexpr int64_t kMaxGapNs = 100'000'000;

 private:
  std::map<int64_t, Rigid3> poses_;
};

}  // namespace tessera
