// What moves by itself in front of the camera: people, cars, a chair that is pushed.
//
// Marks, a keypoint with depth in each piece of the image, are followed for some frames. If all but a few are where one
// motion of the camera puts them, nothing else moves. Otherwise motions on which many agree are looked for, one after
// the other (sequential RANSAC; P. Torr, "Geometric motion segmentation and model selection", 1998), and the scene's is
// the one that explains the larger surface: a piece of the image at depth z counts as z^2, by how well it fits (MSAC;
// P. Torr and A. Zisserman, 2000). A person who stands close and fills half of the image is a small thing. What a
// camera goes on to counts more than what makes it jump.
//
// Only with depth: seen by one camera alone, what drives ahead at the same speed looks as if it stood far away.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "features/feature_types.h"
#include "geometry/pose_optimization.h"
#include "geometry/rigid3.h"
#include "measurement/image_cells.h"

namespace tessera {

// How the camera should have moved since the last frame.
struct ExpectedMotion {
  Rigid3 last_from_current;         // m
  std::optional<double> max_off_m;  // farther from there it has jumped; nullopt: as far as any camera gets
};

class MovingThings {
 public:
  // Each frame once, in the order of their numbers; some may be missing. `expected`: nullopt: as before.
  void Add(const FeatureFrame& features, const std::optional<ExpectedMotion>& expected);
  // The frame that was added last without its keypoints on things that move.
  FeatureFrame Without(FeatureFrame features) const;
  // Whether something goes through the image of the last frame, which the camera's own carrier does not.
  bool any_goes() const;

 private:
  struct Mark {
    Eigen::Vector3d point;        // in the marked frame's camera
    Eigen::Vector3d depth_sigma;  // of it, along the line of sight
    Descriptor descriptor;        // as it was seen last, as all that follows
    int level = 0;
    Eigen::Vector2d pixel_px;
    Eigen::Vector2d step_px = Eigen::Vector2d::Zero();  // how it got there
    int32_t keypoint = -1;                              // of the last frame; -1: it wasn't seen
    bool is_of_scene = true;                            // it was where the scene's motion puts it
    bool is_moving = false;                             // it is on something that moves
  };
  // A motion of the camera since the marked frame.
  struct Motion {
    Rigid3 current_from_marked;
    std::vector<char> agrees;      // by observation
    std::vector<double> surfaces;  // by observation: what it explains of it, m^2 up to a factor
    bool goes_on = false;          // the camera is where it was expected
  };
  // What the last frame showed of a mark.
  struct Label {
    double depth_m = 0.0;  // 0: unknown
    bool is_moving = false;
  };

  void Restart(const CameraCalibration& camera);
  void SetMarks(const FeatureFrame& features);
  void FollowMarks(const FeatureFrame& features, const Rigid3& expected);
  // Of the marks that were seen, in their order.
  std::vector<PoseObservation> Observe(const FeatureFrame& features) const;
  // The scene's first.
  std::vector<Motion> FindMotions(std::vector<PoseObservation>& observations, uint64_t seed, const Rigid3& expected,
                                  double max_off_m) const;
  // By those observations that vote.
  Motion MotionBy(std::span<const char> votes, const Rigid3& guess, std::vector<PoseObservation>& observations) const;
  std::vector<double> SurfacesOf(const Motion& motion, const std::vector<PoseObservation>& observations,
                                 double max_depth_m) const;
  static bool ExplainsMore(const Motion& one, const Motion& other);
  // How many standard deviations a mark is from where this motion puts it.
  double MissOf(const PoseObservation& observation, const Rigid3& current_from_marked) const;
  // By observation: whether it is clearly elsewhere.
  std::vector<char> AreOff(const std::vector<PoseObservation>& observations, const Rigid3& current_from_marked) const;
  void LabelMarks(const std::vector<PoseObservation>& observations, const std::vector<Motion>& motions, int64_t age_us);
  void KeepLabels(const FeatureFrame& features);
  bool Covers(const FeatureFrame& features, int32_t keypoint) const;

  CameraCalibration camera_;
  ImageCells grid_;
  std::vector<Mark> marks_;
  int64_t marked_us_ = 0, last_us_ = 0;  // times of the marked and the last frame
  int most_seen_ = 0;                    // of the marks, in a frame
  Rigid3 last_from_marked_;              // of the scene
  Rigid3 step_;                          // current_from_last at the last frame
  Eigen::Vector3d marked_turn_ = Eigen::Vector3d::Zero(), last_turn_ = Eigen::Vector3d::Zero();  // rad/s
  std::vector<std::vector<Label>> labels_;  // by piece of the image, row by row
  int num_moving_ = 0;                      // of these
  int num_going_ = 0;                       // the same, but for what stands still in the image
};

}  // namespace tessera
