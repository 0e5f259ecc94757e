// What closing loops and finding a lost camera again exchange: LOOP_RESULT, GLOBAL_ADJUSTMENT, RELOCALIZATION_REQUEST
// and RELOCALIZATION.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/ids.h"
#include "features/feature_types.h"
#include "geometry/rigid3.h"

namespace tessera {

// A keypoint of a frame sees a landmark.
struct SeenLandmark {
  int32_t keypoint = -1;
  LandmarkId landmark;
  bool operator==(const SeenLandmark&) const = default;
};

// What the loop closer found at a keyframe, on the map as it was after the delta that answered it. Each keyframe gets
// one result, mostly "no loop": so the mapper knows when it has all that it must wait for.
struct LoopResult {
  struct Correction {
    KeyframeId id;
    Sim3 new_world_from_old;  // moves the keyframe and what it sees; scale 1 but for mono
  };
  KeyframeId answers;
  KeyframeId matched;                   // the keyframe of the place seen again; invalid: no loop
  Sim3 matched_from_current;            // camera frames, in units of the map at `matched` and at `answers`
  bool joins_parts = false;             // the two belonged to different parts of the map
  std::vector<Correction> corrections;  // by id. Keyframes that are not named move with their parents
  std::vector<SeenLandmark> seen;       // landmarks of the older place that `answers` sees, by keypoint

  // How far the candidates came: so many were found by their words, ...
  int32_t num_candidates = 0;
  int32_t num_consistent = 0;    // ... so many of them also from the keyframes before, ...
  int32_t num_matched = 0;       // ... had enough matching landmarks, ...
  int32_t num_aligned = 0;       // ... and a similarity that many of them agree with; more confirm `matched` ...
  int32_t num_contradicted = 0;  // ... or did for these, which contradict the map by far
};

// A bundle adjustment of all that hangs together with a closed loop, begun on the map after the delta that answers
// `answers` and asks for it.
struct GlobalAdjustment {
  struct Pose {
    KeyframeId id;
    Rigid3 world_from_camera;
  };
  struct Point {
    LandmarkId id;
    Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
  };

  KeyframeId answers;
  int64_t delta = -1;         // number of that delta: at the end of a run several answer the last keyframe
  bool is_usable = false;     // false: the solver found nothing better
  std::vector<Pose> poses;    // by id
  std::vector<Point> points;  // by id
};

// The tracker does not know where it is.
struct RelocalizationRequest {
  FeatureFrame features;
  KeyframeId last_keyframe;  // the map to be searched is that after the delta that answers it; invalid: the one loaded
};

// Where the frame was taken. The tracker checks it against its own map.
struct RelocalizationAnswer {
  FrameId frame;
  KeyframeId reference;            // a keyframe that shows the same place; invalid: none was found
  Rigid3 reference_from_camera;    // in its units (Keyframe::scale)
  std::vector<SeenLandmark> seen;  // by keypoint
  int32_t num_candidates = 0;      // places that looked alike
};

}  // namespace tessera
