// The way of a camera since it was lost: it turned as consecutive frames show, and went on as fast as it did, straight
// ahead in its own axes. A guess, of which the turn is good as long as frames show anything.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "geometry/rigid3.h"
#include "geometry/two_view.h"
#include "matching/matching.h"
#include "measurement/frame_view.h"

namespace tessera {

struct LostWayOptions {
  MatchingOptions matching{50, 0.9, true};
  double radius_share = 0.15;  // search window: +- this share of the image's longer side around where the turn leads
  TwoViewOptions two_view{.min_points = 20, .min_parallax_rad = 0.002};
  // Of the camera's way in its axes, an axis: from image to image, turning is hardly told from moving aside.
  double direction_sigma_rad = 0.01;
};

class LostWay {
 public:
  using Frame = std::shared_ptr<const FrameView>;

  explicit LostWay(const LostWayOptions& options = {}) : options_(options) {}

  // `last`: the last frame that was tracked. `velocity` (units of the world/s, zero if unknown) and `turn_rate` (rad/s)
  // in its axes.
  void Begin(Frame last, const Rigid3& world_from_last, const Eigen::Vector3d& velocity,
             const Eigen::Vector3d& turn_rate);
  // The next frame, lost as well. Its time must not lie before the last one's.
  void Add(const Frame& view);
  void End() { poses_.clear(); }

  bool has_begun() const { return !poses_.empty(); }
  double speed() const { return velocity_.norm(); }  // units/s; 0: unknown
  // world_from_camera of a frame since Begin(), or of the newest one before it. Identity before Begin().
  Rigid3 PoseAt(int64_t utime_us) const;

 private:
  struct PoseAtTime {
    int64_t utime_us = 0;
    Rigid3 world_from_camera;
  };

  std::optional<Eigen::Quaterniond> TurnTo(const FrameView& view, const Eigen::Quaterniond& expected) const;

  const LostWayOptions options_;
  Frame anchor_;  // that the next one is compared with: the newest that had turned
  Eigen::Quaterniond world_from_anchor_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_rate_ = Eigen::Vector3d::Zero();
  std::vector<PoseAtTime> poses_;  // the newest ones
};

}  // namespace tessera
