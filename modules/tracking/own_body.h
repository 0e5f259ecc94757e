// What moves with the camera: the bonnet of its car, a robot's arm, a time stamp in the image, dirt on the lens.
//
// Its keypoints stay where they are in the image, and agree with one another on a camera that stands still. What tells
// them from the scene is what the rest of the image does. Keypoints are marked, and looked for again when most of the
// image has gone on. A camera that turns moves all of the scene; one that goes moves what is near more than what is
// far. So whatever still stands where it was is of the body, if
//   - hardly anything else moved only a little (the camera turned), or
//   - most of what moved is farther away.
// What is farther than anything that carries a camera is none of it: a lorry that drives in front.
// While the camera stands and a bus goes by, the scene stands still, too: but where it stands, other things were seen
// to come and go before.
#pragma once

#include <cstdint>
#include <vector>

#include "features/feature_types.h"
#include "map/map.h"
#include "measurement/image_cells.h"

namespace tessera {

class OwnBody {
 public:
  // Each frame once, in the order of their numbers; some may be missing.
  void Add(const FeatureFrame& features);
  // The frame without its keypoints on the body, as far as the frames so far have shown it.
  FeatureFrame Without(FeatureFrame features) const;

  // In pixels as the source gives them.
  bool Covers(const Keypoint& keypoint) const { return !cells_.empty() && cells_[Index(CellOf(keypoint))].is_body; }
  // Of the image.
  double share() const { return cells_.empty() ? 0.0 : static_cast<double>(num_body_) / grid_.num(); }
  // How many pieces of the image have ever been taken for the body.
  int num_found() const { return num_found_; }

 private:
  // A square piece of the image.
  struct Cell {
    int score = 0;  // grows where marks stand still while they should not, and falls where they go
    bool is_body = false;
    bool was_body = false;
  };
  struct Mark {
    Keypoint keypoint;
    Descriptor descriptor;
    double depth_m = 0.0;  // 0: unknown
    int cell = 0;
  };
  // What became of the marks of a cell.
  struct CellMarks {
    int num = 0, num_still = 0, num_near = 0;  // of these, where they were, and a little beside it
    double depth_m = 0.0;                      // of one of them; 0: unknown
    bool IsStill() const { return num > 0 && 2 * num_still >= num; }
    bool HasGone() const { return num > 0 && num_still + num_near == 0; }
  };
  // What all of them say about how the camera moved.
  struct Scene {
    bool stands = false;  // where the scene was seen before, marks stand still: something else moves
    bool turns = false;
    std::vector<double> gone_depths_m;  // of cells that have gone, in their order
    int num_gone = 0;

    // Whether marks at this depth (m; 0: unknown) can't be of the scene if they stand still.
    bool Contradicts(double depth_m) const;
    bool IsNearerThanMost(double depth_m) const;
  };

  int CellOf(const Keypoint& keypoint) const { return grid_.Of(keypoint.x_px, keypoint.y_px); }
  void Restart(const CameraCalibration& camera);
  void SetMarks(const FeatureFrame& features);
  std::vector<CellMarks> LookForMarks(const FeatureFrame& features) const;
  Scene Judge(const std::vector<CellMarks>& marks) const;
  void Count(const std::vector<CellMarks>& marks, const Scene& scene);
  void FindBody();

  CameraCalibration camera_;
  ImageCells grid_;
  std::vector<Cell> cells_;
  std::vector<Mark> marks_;  // keypoints of one frame, a few of each cell
  int64_t marked_us_ = 0;    // when it was taken
  int64_t looked_us_ = 0;    // when they were looked for last
  int num_body_ = 0, num_found_ = 0;
};

// Landmarks that have been seen on the body alone.
std::vector<LandmarkId> LandmarksOn(const OwnBody& body, const Map& map);

}  // namespace tessera
