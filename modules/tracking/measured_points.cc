#include "tracking/measured_points.h"

#include "geometry/reprojection.h"
#include "measurement/landmark_description.h"

namespace tessera {

std::vector<int> MeasuredPoints(const TrackedFrame& frame, int max_num) {
  std::vector<int> measured;
  const Rigid3 frame_from_world = frame.world_from_camera.Inverse();
  const int step = 1 + frame.NumPoints() / max_num;
  int num_seen = 0;
  for (int i = 0; i < frame.view->size(); ++i) {
    const SeenPoint& seen = frame.points[Index(i)];
    if (!seen.valid() || num_seen++ % step != 0) continue;
    if (!HasDepth(seen.landmark, frame.world_from_camera.translation)) continue;
    const Eigen::Vector3d point = frame_from_world * seen.landmark.position_in_world;
    if (frame.view->observation(i).has_right() && point.z() >= kMinDepth) measured.push_back(i);
  }
  return measured;
}

}  // namespace tessera
