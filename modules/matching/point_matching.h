// Which keypoint of a frame sees which known point.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "matching/point_id.h"
#include "measurement/landmark_view.h"

namespace tessera {

struct MatchOptions {
  double last_radius_px = 15.0;  // around the prediction from the last frame, at level 0; times the scale of the level
  double local_radius_px = 3.0;  // around the projection with a pose that is nearly right; likewise
  int max_hamming = 100;         // bits of 256: patches of one point under changed view, nearly always
  double max_hamming_ratio = 0.8;  // best match to the second best

  Result<> Check() const;
};

using KnownPoints = std::vector<std::pair<PointId, Landmark>>;  // in world coordinates

// A point that a frame sees.
struct SeenPoint {
  PointId id;
  Landmark landmark;  // in world coordinates, as it was when it was matched

  bool valid() const { return id.valid(); }
};

// A frame that is being localized: its features, its pose, and by keypoint the points that it sees.
struct TrackedFrame {
  explicit TrackedFrame(std::shared_ptr<const FrameView> frame_view)
      : view(std::move(frame_view)), points(static_cast<size_t>(view->size())) {}

  int NumPoints() const;
  // Along the optical axis, of the points that it sees; 0 if it sees none.
  double MedianDepth() const;

  std::shared_ptr<const FrameView> view;
  Rigid3 world_from_camera;
  std::vector<SeenPoint> points;  // by keypoint
};

// Points that `last` sees, looked for around their projection into `frame` at its (predicted) pose: on a level next to
// theirs, with their orientation. Sets frame.points; returns how many.
int MatchLast(const TrackedFrame& last, double radius_px, const MatchOptions& options, TrackedFrame& frame);

// Known points that `frame` sees none of yet, looked for around their projection at its pose. Adds to frame.points;
// returns how many.
int MatchLocal(const KnownPoints& points, double radius_px, const MatchOptions& options, TrackedFrame& frame);

// Known points, wherever they may be in the image, by descriptor alone. Sets frame.points; returns how many.
int MatchAnywhere(const KnownPoints& points, const MatchOptions& options, TrackedFrame& frame);

// How many of the points the frame should see, at its pose.
int NumExpected(const KnownPoints& points, const TrackedFrame& frame);

// The share of image cells with a match (1/16 of the longer side each), of those cells in which the frame, at its pose,
// should see several of the points. An object found in two places, such as a parked car of the same make, agrees with a
// pose as well as a place does; but what is around the object is not seen then.
double Coverage(const KnownPoints& points, const TrackedFrame& frame);

}  // namespace tessera
