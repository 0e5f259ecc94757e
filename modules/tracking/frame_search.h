// One frame's search for its pose, from the last frame that was tracked.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "geometry/epipolar.h"
#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"
#include "tracking/map_replica.h"

namespace tessera {

struct FrameSearchOptions {
  MatchOptions matching;
  PoseOptimizationOptions pose;
  int min_last_matches = 20;     // fewer from the last frame: look in wider windows
  int max_local_keyframes = 30;  // whose landmarks are looked for

  Result<> Check() const;
};

// What the motion so far says of a frame.
struct ExpectedFrame {
  Rigid3 world_from_camera;
  std::optional<DirectionPrior>
      way;                         // from the last frame, whatever the turn, world units; nullopt: no motion is known
  std::optional<PosePrior> prior;  // how well the position is known, if the camera was watched for long enough
  double turn_sigma_rad = 0.0;     // how well the turn is, an axis
  // A camera that is farther from where it is expected has jumped, world units.
  double max_off = std::numeric_limits<double>::infinity();
};

struct FoundFrame {
  TrackedFrame frame;
  // It was found only in a wider window, or elsewhere than expected: half of its points lie outside the usual window
  // around where they should be.
  bool is_wide = false;
  // So few of the last frame's points agree that a look at what should be seen, too, must confirm the pose.
  bool is_doubtful = false;
};

class FrameSearch {
 public:
  using Frame = std::shared_ptr<const FrameView>;

  // `last`, `replica` and `options` must outlive the search. `by_confirmed`: FindAnywhere() looks for confirmed points
  // only, and the try with the most of them is the best.
  FrameSearch(Frame view, const TrackedFrame& last, const ExpectedFrame& expected, const MapReplica& replica,
              const FrameSearchOptions& options, bool by_confirmed = false);

  const Frame& view() const { return view_; }

  // The last frame's points, in windows around where the motion leads, ever wider; then from where the points around
  // the last frame are found by descriptor alone (before a motion is known, from three such poses), and from how the
  // two frames as such show the motion. The first clear try ends it, else the best one counts, if any has enough
  // inliers.
  std::optional<FoundFrame> Follow();
  // Without an expected pose: the points around the last frame, matched by descriptor alone. Computed once.
  std::optional<FoundFrame> FindAnywhere();
  // Where the last frame and this one by themselves show the camera, in world coordinates. Computed once.
  const std::optional<Rigid3>& PoseByPair();
  // Mono: whether the two frames by themselves show that the camera turned otherwise. To be asked where few points
  // agree with a pose: on a wall or a fence they do so in several places. False where the turn was known beforehand to
  // less than the usual window, or is what a steady motion expected: among trees that look alike, two frames know it no
  // better.
  bool PairContradicts(const Rigid3& world_from_camera);

 private:
  // The best of several tries.
  struct Best {
    std::optional<TrackedFrame> frame;
    int num_inliers = 0;
    int num_confirmed = 0;  // of these
    int num_cells = 0;      // see NumCells(); 0: not needed
    bool goes_on = false;
    int num_tries = 0;
  };

  const std::vector<FoundFrame>& Anywhere();
  bool knows_motion() const { return expected_.way.has_value(); }
  // Poses on which points that are matched by descriptor alone agree, each without the points of those before.
  std::vector<FoundFrame> SearchAnywhere(int max_num) const;
  std::optional<Rigid3> SearchByPair() const;
  bool IsBetter(const Best& one, const Best& best) const;
  bool GoesOn(const Rigid3& world_from_camera) const;
  bool TryAt(const Rigid3& world_from_camera, double widening, const PosePrior* prior, Best& best) const;
  double ExpectedSigma_px() const;
  bool IsAsExpected(const Rigid3& world_from_camera) const;
  bool IsWide(const TrackedFrame& frame) const;

  const Frame view_;
  const TrackedFrame& last_;
  const ExpectedFrame expected_;
  const MapReplica& replica_;
  const FrameSearchOptions& options_;
  const bool by_confirmed_;
  std::optional<std::vector<FoundFrame>> anywhere_;
  std::optional<std::optional<Rigid3>> by_pair_;
};

}  // namespace tessera
