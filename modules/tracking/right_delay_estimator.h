// How much later than the left one the right camera of a stereo pair takes its image (measurement/right_delay.h), by
// what the images show.
//
// While the camera moves, the column at which the right camera sees a point changes by f per second (RightColumnRate).
// If the delay is d, of which u was taken out, the frame's right columns are off by (d - u) f. The map has its depths
// from disparities that are wrong likewise: a point that keyframe k sees with a disparity q(k) lies too far from it by
// a share (d - u(k)) f(k) / q(k), and one that several see by their mean, weighed by q(k)^2, as exact as each knows it.
// But the way between them tells depths, too, so only a part m of that is there:
//
//   shift = m sum of (d - u(k)) q(k) f(k) (point - camera(k)) / sum of q(k)^2
//   r = J p - (0, 0, d - u) f + by_point shift + (0, 0, c + e y)
//
// where J p comes from the error p of the frame's pose, and c and e from a right camera that squints or is twisted: one
// frame that turns can't tell them from a delay, but many can. Eliminating p, the equations of the last frames are
// added up, each only as far as its motion and the map are known, and solved for d, c and e. A camera that moves as it
// did at its keyframes says little.
//
// Other things that are wrong look a little like a delay. To be found, one must explain a share of what is seen, d^2 /
// v / n with the variance v of d and the number n of measurements; and no longer much less of it than before, as a
// squint does while the map corrects it. What is found stays, and follows clocks that drift.
#pragma once

#include <map>
#include <optional>

#include "matching/point_matching.h"
#include "measurement/rolling_shutter.h"
#include "tracking/map_replica.h"

namespace tessera {

class RightDelayEstimator {
 public:
  // `frame` was tracked with right columns moved by delay_s(), and outliers are removed; its camera moved by `motion`.
  void Add(const TrackedFrame& frame, const CameraMotion& motion, const MapReplica& replica);
  // That frame became a keyframe. Ids grow. Unknown motion: nothing was taken out, and that of the next frame counts.
  void AddKeyframe(KeyframeId id, const std::optional<CameraMotion>& motion);
  // The next frame doesn't follow.
  void ForgetMotion();
  // > 0: the right image is taken after the left one. 0 until it is known that it isn't.
  double delay_s() const { return is_found_ ? delay_s_ : 0.0; }

 private:
  // A keyframe's motion when it was taken, and what was taken out of its right columns.
  struct Taken {
    std::optional<CameraMotion> motion;
    double delay_s = 0.0;
  };

  // Of the map's point, as above: by how much it is moved by each second of delay, and by what was taken out; meters,
  // in the world. nullopt: nothing is known of who sees it.
  struct Shift {
    Eigen::Vector3d by_delay = Eigen::Vector3d::Zero(), taken_out = Eigen::Vector3d::Zero();
  };
  std::optional<Shift> ShiftOf(const SeenPoint& seen, const CameraCalibration& camera, const MapReplica& replica) const;
  // For d, c and e, divided by the variance of noise. nullopt: too few points.
  struct Equations {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    double num_measured = 0.0;
  };
  std::optional<Equations> EquationsOf(const TrackedFrame& frame, const CameraMotion& motion,
                                       const MapReplica& replica) const;

  Equations sum_;  // of the last frames, the latest counting most
  int num_frames_ = 0;
  double delay_s_ = 0.0;
  double most_explained_ = 0.0;  // by a delay
  bool is_found_ = false;
  double taken_out_s_ = 0.0;               // of the last frame
  std::map<KeyframeId, Taken> keyframes_;  // the newest
};

}  // namespace tessera
