#include "matching/point_matching.h"

#include <algorithm>
#include <utility>

#include "core/quantile.h"
#include "measurement/image_cells.h"

namespace tessera {
namespace {

// The best claim to each keypoint.
class Claims {
 public:
  explicit Claims(size_t num_keypoints) : distances_(num_keypoints, 257) {}

  // The lower distance wins; of equals the first.
  void Claim(int32_t keypoint, int distance, const PointId& id, const Landmark& landmark,
             std::vector<SeenPoint>& points) {
    if (distance < distances_[Index(keypoint)]) {
      distances_[Index(keypoint)] = distance;
      points[Index(keypoint)] = {id, landmark};
    }
  }

 private:
  std::vector<int> distances_;
};

// Whether the right column, where both have one, fits the expected one.
bool IsRightNear(const PixelObservation& seen, const CameraCalibration& calibration, const ExpectedView& expected,
                 double radius_px) {
  if (!seen.has_right()) return true;
  const double right_x_px = expected.pixel_px.x() - calibration.fx_px * Baseline(calibration) / expected.depth;
  return std::abs(seen.right_x_px - right_x_px) <= radius_px;
}

}  // namespace

Result<> MatchOptions::Check() const {
  if (!(last_radius_px > 0.0) || !(local_radius_px > 0.0)) return Failed("search radii of matching must be positive");
  if (max_hamming < 1 || max_hamming > 256) return Failed("max_hamming of matching must be between 1 and 256");
  return {};
}

int TrackedFrame::NumPoints() const {
  return static_cast<int>(std::count_if(points.begin(), points.end(), [](const SeenPoint& p) { return p.valid(); }));
}

double TrackedFrame::MedianDepth() const {
  const Rigid3 camera_from_world = world_from_camera.Inverse();
  std::vector<double> depths;
  for (const SeenPoint& point : points) {
    if (point.valid()) depths.push_back((camera_from_world * point.landmark.position_in_world).z());
  }
  return depths.empty() ? 0.0 : OrderStatistic(std::move(depths), 0.5);
}

int MatchLast(const TrackedFrame& last, double radius_px, const MatchOptions& options, TrackedFrame& frame) {
  frame.points.assign(frame.points.size(), {});
  Claims claims(frame.points.size());
  const View view(frame.view->calibration(), frame.world_from_camera);
  const Rigid3 current_from_last = frame.world_from_camera.Inverse() * last.world_from_camera;
  const uint8_t roll = RollBetween(current_from_last);
  for (size_t i = 0; i < last.points.size(); ++i) {
    if (!last.points[i].valid()) continue;
    const Eigen::Vector3d point = view.rotation * last.points[i].landmark.position_in_world + view.translation;
    if (point.z() <= 0.0) continue;
    const Eigen::Vector2d pixel = view.calibration.Project(point);
    const Keypoint& from = last.view->keypoint(static_cast<int>(i));
    const PatchRange range = PatchRange::Levels(from.level - 1, from.level + 1).WithAnglesNear(from.angle + roll);
    int best_distance = options.max_hamming + 1;
    int32_t best = -1;
    frame.view->grid().VisitWindow(pixel, radius_px * LevelScale(from.level), range, [&](const PlacedKeypoint& to) {
      const int distance =
          HammingDistance(last.view->descriptor(static_cast<int>(i)), frame.view->descriptor(to.index));
      if (distance < best_distance) {
        best_distance = distance;
        best = to.index;
      }
    });
    if (best >= 0) claims.Claim(best, best_distance, last.points[i].id, last.points[i].landmark, frame.points);
  }
  return frame.NumPoints();
}

int MatchLocal(const KnownPoints& points, double radius_px, const MatchOptions& options, TrackedFrame& frame) {
  std::vector<char> was_seeing(frame.points.size());  // by keypoint
  for (size_t i = 0; i < was_seeing.size(); ++i) was_seeing[i] = frame.points[i].valid() ? 1 : 0;
  Claims claims(frame.points.size());
  const View view(frame.view->calibration(), frame.world_from_camera);
  for (const auto& [id, landmark] : points) {
    const std::optional<ExpectedView> expected = Expect(view, landmark);
    if (!expected) continue;
    // Seen as before, a point is found close to where it should be (ORB-SLAM: Mur-Artal et al. 2015).
    const double radius = radius_px * (expected->cos_angle > 0.998 ? 0.625 : 1.0) * LevelScale(expected->level);
    int best_distance = options.max_hamming + 1, second_distance = 257, best_level = -1, second_level = -1;
    int32_t best = -1;
    const PatchRange range = PatchRange::Levels(expected->level - 1, expected->level);
    frame.view->grid().VisitWindow(expected->pixel_px, radius, range, [&](const PlacedKeypoint& placed) {
      const int level = placed.level;
      const int32_t candidate = placed.index;
      if (was_seeing[Index(candidate)] != 0) return;
      if (!IsRightNear(frame.view->observation(candidate), view.calibration, *expected, radius)) return;
      const int distance = HammingDistance(landmark.descriptor, frame.view->descriptor(candidate));
      if (distance < best_distance) {
        second_distance = best_distance;
        second_level = best_level;
        best_distance = distance;
        best_level = level;
        best = candidate;
      } else if (distance < second_distance) {
        second_distance = distance;
        second_level = level;
      }
    });
    if (best < 0) continue;
    if (best_level == second_level && best_distance > options.max_hamming_ratio * second_distance) continue;
    claims.Claim(best, best_distance, id, landmark, frame.points);
  }
  return frame.NumPoints();
}

int MatchAnywhere(const KnownPoints& points, const MatchOptions& options, TrackedFrame& frame) {
  frame.points.assign(frame.points.size(), {});
  Claims claims(frame.points.size());
  for (const auto& [id, landmark] : points) {
    int best_distance = options.max_hamming / 2 + 1, second_distance = 257;
    size_t best = 0;
    for (size_t i = 0; i < frame.points.size(); ++i) {
      const int distance = HammingDistance(landmark.descriptor, frame.view->descriptor(static_cast<int>(i)));
      if (distance < best_distance) {
        second_distance = best_distance;
        best_distance = distance;
        best = i;
      } else if (distance < second_distance) {
        second_distance = distance;
      }
    }
    if (best_distance <= options.max_hamming / 2 && best_distance <= options.max_hamming_ratio * second_distance) {
      claims.Claim(static_cast<int32_t>(best), best_distance, id, landmark, frame.points);
    }
  }
  return frame.NumPoints();
}

int NumExpected(const KnownPoints& points, const TrackedFrame& frame) {
  const View view(frame.view->calibration(), frame.world_from_camera);
  return static_cast<int>(std::count_if(points.begin(), points.end(),
                                        [&](const auto& point) { return Expect(view, point.second).has_value(); }));
}

double Coverage(const KnownPoints& points, const TrackedFrame& frame) {
  constexpr int kCellsAlong = 16, kMinExpected = 3;
  const CameraCalibration& camera = frame.view->calibration();
  const ImageCells cells(camera, kCellsAlong);
  std::vector<int> num_expected(Index(cells.num()), 0);
  const View view(camera, frame.world_from_camera);
  for (const auto& [id, landmark] : points) {
    const std::optional<ExpectedView> expected = Expect(view, landmark);
    if (expected) ++num_expected[Index(cells.Of(expected->pixel_px.x(), expected->pixel_px.y()))];
  }
  std::vector<char> is_shown(num_expected.size(), 0);
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Eigen::Vector2d pixel_px = frame.view->observation(static_cast<int>(i)).pixel_px;
    is_shown[Index(cells.Of(pixel_px.x(), pixel_px.y()))] = 1;
  }
  int num_cells = 0, num_shown = 0;
  for (size_t cell = 0; cell < num_expected.size(); ++cell) {
    if (num_expected[cell] < kMinExpected) continue;
    ++num_cells;
    num_shown += is_shown[cell];
  }
  return num_cells > 0 ? static_cast<double>(num_shown) / num_cells : 0.0;
}

}  // namespace tessera
