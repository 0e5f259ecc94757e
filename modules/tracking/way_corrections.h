// What the residuals of a frame can't show of its error: the map that it is seen against may be bent as a whole, as one
// of mono that has just begun, or where a camera sees little that is near. Then the mapper moves what it gets. So the
// ways between the last keyframes, as the tracker sent them and as they are in the map by now, tell how far the
// covariances of such ways can be trusted.
#pragma once

#include <deque>
#include <optional>

#include "geometry/body_state.h"
#include "tracking/map_replica.h"

namespace tessera {

class WayCorrections {
 public:
  // A part of the map begins with keyframes that this tracker sends.
  void BeginPart(bool is_mono);
  // A keyframe is sent. `reference_from_keyframe`: in the reference's units; `covariance`: of delta in
  // reference_from_keyframe * Exp(delta), as the residuals of both ends show it.
  void Send(KeyframeId reference, KeyframeId keyframe, const Rigid3& reference_from_keyframe,
            const Matrix6d& covariance);
  // Looks at the ways once more; to be called when the map has changed.
  void Update(const MapReplica& replica);

  // What to multiply covariances by:  max(1, mean of  d' covariance^-1 d / dof)  over the last ways that the mapper has
  // answered, where  sent * Exp(d) = way in the map.  In mono, whose units the mapper may change, d is free along the
  // way, and dof is 5, else 6. nullopt: a map of mono is so young that nothing is known of its errors.
  std::optional<double> variance_factor() const;

 private:
  struct Way {
    KeyframeId reference, keyframe;
    Rigid3 sent;
    Matrix6d covariance;
    std::optional<double> excess;  // d' covariance^-1 d / dof, once answered
  };
  double ExcessOf(const Way& way, const Rigid3& corrected) const;

  std::deque<Way> ways_;  // the last ones
  bool is_mono_ = false;
  bool is_young_ = false;
};

}  // namespace tessera
