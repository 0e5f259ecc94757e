// The start of mono: two frames that together give a camera motion and points.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/triangulation.h"
#include "geometry/two_view.h"
#include "matching/matching.h"
#include "measurement/frame_view.h"

namespace tessera {

struct InitializerOptions {
  double radius_share = 0.1;  // search window: +- this share of the longer side around the position in the last frame
  int min_matches = 100;      // with fewer, the newest frame becomes the reference
  int max_frames = 40;        // of the reference; an older one is replaced likewise
  MatchingOptions matching{50, 0.9, true};
  TwoViewOptions two_view;

  Result<> Check() const;
};

struct MonoStart {
  struct Point {
    int32_t keypoint_first = -1;
    int32_t keypoint_second = -1;
    PointRefinement point;  // in the first camera's frame
  };
  std::shared_ptr<const FrameView> first;
  std::shared_ptr<const FrameView> second;
  Rigid3 second_from_first;  // in units of the points' median depth in the first camera
  std::vector<Point> points;

  double interval_s() const { return SecondsBetween(*first, *second); }
};

class MonoInitializer {
 public:
  explicit MonoInitializer(const InitializerOptions& options) : options_(options) {}

  // Matches the frame with the reference frame, and returns the start if the two allow one. The first frame with enough
  // keypoints becomes the reference; keypoints are followed from frame to frame.
  std::optional<MonoStart> Add(const std::shared_ptr<const FrameView>& frame);

 private:
  void SetReference(const std::shared_ptr<const FrameView>& frame);
  MonoStart MakeStart(const std::shared_ptr<const FrameView>& frame, const std::vector<Match>& matches,
                      const TwoViewResult& views) const;

  InitializerOptions options_;
  std::shared_ptr<const FrameView> reference_;
  std::vector<Eigen::Vector2d> last_seen_px_;  // by keypoint of the reference
  std::vector<Rigid3> guesses_;                // the best motion of the last try: samples alone may miss it in this one
};

}  // namespace tessera
