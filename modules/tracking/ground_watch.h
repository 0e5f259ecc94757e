// What the ground tells of a mono camera that is carried over it at a constant height, as on a car: how fast it moves,
// and so the scale, also where nothing else near is seen, and after a loss. Whether a camera is carried so is learned
// from how it moves; of one in a hand or on a drone, nothing is said.
//
// Speeds over the ground come in heights (matching/ground_speed.h), those of the map in its units; while the map is
// known to be right, their ratio is the height in units of the map:
//
//   log height = log(length of a step / interval) - log(speed over the ground)
#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <vector>

#include "geometry/rigid3.h"
#include "measurement/frame_view.h"
#include "tracking/ground_speed_filter.h"
#include "tracking/scale_mending.h"

namespace tessera {

class GroundWatch {
 public:
  struct Step {
    Rigid3 last_from_current;          // in units of the map, not 0
    double interval_s = 0.0;           // > 0
    double direction_sigma_rad = 0.0;  // of the way, across it, as the images have it
    bool is_seen = true;               // by the images alone, not by how the camera moved before
    KeyframeId reference;              // from which both frames were tracked
  };
  // The camera moved so from one frame to the next.
  void Add(const FrameView& last, const FrameView& current, const Step& step);
  // Units of the map have become smaller by this factor: a loop has scaled what is around.
  void Rescale(double factor);
  // Another part of the map begins with the camera still as high. `is_guess`: its scale is, until it is mended.
  void BeginPart(KeyframeId first, bool is_guess);
  // The way goes on from an earlier place of this part.
  void ForgetSteps();
  // It goes on in another part, of whose scale nothing is known.
  void ForgetHeight();

  // The length in units of the map of a step between two frames at the end of `gap_s` >= 0 in which the ground was not
  // seen; only the direction of `last_from_current` matters. nullopt: the ground doesn't tell it.
  std::optional<double> LengthAfterGap(const FrameView& last, const FrameView& current, const Rigid3& last_from_current,
                                       double interval_s, double gap_s);

  // By how much the logarithm of the map's scale has fallen since the height was learned, as far as the ground shows it
  // clearly: in most of the last 20 steps that it told, and by more than roads bend. 0: it has not, or nothing is
  // known.
  double ScaleFall() const;

  // What mends the map where its scale has slipped, once it stays as it is: it has fallen so clearly (ScaleFall), or
  // was another one for long. And what brings a part whose scale is a guess to that of the part before. Empty: there is
  // nothing to mend, or not yet.
  std::vector<ScaleMending> Mendings() const;
  // The map has been mended so. `since`: the last keyframe that was named. From there on the scale is an estimate, of
  // which a better one follows when more of the ground has been seen.
  void NoteMended(KeyframeId since);

  // The height of the camera in units of the map; nullopt: not known, or not constant.
  std::optional<double> height() const;

 private:
  struct Estimate {
    KeyframeId since;
    size_t num_heights = 0;  // that make a better one
  };

  void LearnDirection(const Eigen::Vector3d& direction);
  void LearnHeight(double log_height);
  bool HasSettled(size_t num_heights) const;
  bool IsElsewhereForLong() const;
  Eigen::Vector3d Direction(const Step& step, const Eigen::Vector3d& seen) const;
  std::optional<Eigen::Vector3d> Down() const;

  int num_steps_ = 0;
  // In the camera, of the steps that images have shown well.
  int num_directions_ = 0;
  Eigen::Vector3d mean_direction_ = Eigen::Vector3d::Zero();
  double direction_variance_ = 0.0;                              // across, an axis
  Eigen::Matrix3d direction_moments_ = Eigen::Matrix3d::Zero();  // mean of direction * direction'
  GroundSpeedFilter speed_;
  std::vector<GroundStep> steps_;   // the last ones, of one way through this part of the map
  std::deque<double> log_heights_;  // the last ones
  std::optional<double> log_height_;
  int num_in_height_ = 0;             // heights that it is the mean of
  std::optional<Estimate> estimate_;  // the scale is one, and may be off
  int num_elsewhere_ = 0;             // the last ones that were far from it, without one between them that was not
};

}  // namespace tessera
