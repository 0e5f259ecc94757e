#include "tracking/pair_points.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/quantile.h"
#include "matching/epipolar_search.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

constexpr size_t kMinDepths = 20;  // fewer known points don't tell how near others may be
constexpr double kMinStep = 1e-9;

// Of the nearest points that the pair may see, along the frame's optical axis.
double MinDepth(const TrackedFrame& frame, double step) {
  const Rigid3 camera_from_world = frame.world_from_camera.Inverse();
  std::vector<double> depths;
  for (const SeenPoint& point : frame.points) {
    if (!point.valid() || !HasDepth(point.landmark, frame.world_from_camera.translation)) continue;
    depths.push_back((camera_from_world * point.landmark.position_in_world).z());
  }
  if (depths.size() < kMinDepths) return 0.5 * step;
  return OrderStatistic(std::move(depths), 0.05) / 3.0;
}

// By keypoint: whether it sees a known point.
std::vector<char> UsedKeypoints(const TrackedFrame& other) {
  std::vector<char> is_used(other.points.size());
  for (size_t i = 0; i < is_used.size(); ++i) is_used[i] = other.points[i].valid() ? 1 : 0;
  return is_used;
}

Landmark Describe(const FrameView& view, int32_t keypoint, const FrameView& other, int32_t other_keypoint,
                  const Rigid3& other_from_camera, const Eigen::Vector3d& point_in_camera) {
  Landmark point = DescribeInCamera(view.features(), keypoint, point_in_camera);
  const double distance = point_in_camera.norm();
  const double information = DepthInformation(view.features(), keypoint, Rigid3::Identity(), point) +
                             DepthInformation(other.features(), other_keypoint, other_from_camera.Inverse(), point);
  point.depth_sigma = std::max(kUnconfirmedShare * distance, DepthSigma(information, distance));
  return point;
}

}  // namespace

std::vector<PairPoint> FindPairPoints(const TrackedFrame& frame, const TrackedFrame& other) {
  const Rigid3 other_from_camera = other.world_from_camera.Inverse() * frame.world_from_camera;
  const double step = other_from_camera.translation.norm();
  if (step < kMinStep) return {};
  std::vector<char> is_used = UsedKeypoints(other);
  const EpipolarSearch search(frame.view->features(), other.view->features(), other_from_camera,
                              [&](int32_t keypoint) { return is_used[Index(keypoint)] == 0; }, MinDepth(frame, step),
                              {});
  std::vector<PairPoint> points;
  for (int32_t i = 0; i < frame.view->size(); ++i) {
    if (frame.points[Index(i)].valid()) continue;
    const auto match = search.Find(i);
    if (!match) continue;
    is_used[Index(match->keypoint)] = 1;
    points.push_back(
        {i, match->keypoint,
         Describe(*frame.view, i, *other.view, match->keypoint, other_from_camera, match->point_in_first)});
  }
  return points;
}

}  // namespace tessera
