#include "tracking/own_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "features/erase_keypoints.h"
#include "measurement/feature_grid.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {
namespace {

constexpr int kCellsAlong = 40;            // the image
constexpr int kMarksPerCell = 3;           // the strongest
constexpr int64_t kInterval_us = 90'000;   // at least, between looks
constexpr int64_t kMaxAge_us = 2'000'000;  // of marks
constexpr double kStill_px = 1.0;          // what noise moves a keypoint by; half a pixel of its level, if that is more
constexpr double kNear_px = 4.0;
constexpr int kMaxDistance = 50;                     // of descriptors, bits
constexpr int kMaxStillDistance = 80;                // the same: behind letters and dirt, the scene changes
constexpr double kMinGone = 0.5;                     // share of the cells that have to have gone, to tell anything
constexpr double kMaxNear = 0.15, kMaxStill = 0.45;  // shares of them when the camera has turned
constexpr double kFarther = 1.2;                     // times as far
// A mark that stands still where the scene would move is worth four that went: half of them aren't found again.
constexpr int kStillGain = 4, kOpenGain = 2, kGoneLoss = 1;
constexpr int kBodyScore = 24, kMaxScore = 40, kSceneScore = -100, kMinScore = -300;
constexpr double kReach_m = 8.0;  // of a body; what is farther and stands still drives in front
constexpr int kMinCells = 8;      // of a body
constexpr int kPlain = 30;        // cells nearer than all that moves: one look is enough

}  // namespace

bool OwnBody::Scene::IsNearerThanMost(double depth_m) const {
  if (stands || depth_m == 0.0 || depth_m > kReach_m) return false;
  const auto farther = std::upper_bound(gone_depths_m.begin(), gone_depths_m.end(), kFarther * depth_m);
  return 2 * (gone_depths_m.end() - farther) > num_gone;
}

bool OwnBody::Scene::Contradicts(double depth_m) const {
  if (stands) return false;
  if (depth_m == 0.0) return turns;
  if (depth_m > kReach_m) return false;
  const auto nearer = std::lower_bound(gone_depths_m.begin(), gone_depths_m.end(), depth_m / kFarther);
  const bool is_behind_most = 2 * (nearer - gone_depths_m.begin()) > num_gone;
  return IsNearerThanMost(depth_m) || (turns && !is_behind_most);
}

void OwnBody::Add(const FeatureFrame& features) {
  if (cells_.empty() || features.calibration != camera_) {
    Restart(features.calibration);
    SetMarks(features);
    return;
  }
  if (features.utime_us - looked_us_ < kInterval_us) return;
  looked_us_ = features.utime_us;
  const std::vector<CellMarks> marks = LookForMarks(features);
  const auto num = std::ranges::count_if(marks, [](const CellMarks& cell) { return cell.num > 0; });
  const auto num_gone = std::ranges::count_if(marks, &CellMarks::HasGone);
  const bool has_gone = static_cast<double>(num_gone) >= kMinGone * static_cast<double>(num);
  if (has_gone) {
    Count(marks, Judge(marks));
    FindBody();
  }
  if (has_gone || features.utime_us - marked_us_ > kMaxAge_us) SetMarks(features);
}

FeatureFrame OwnBody::Without(FeatureFrame features) const {
  if (num_body_ == 0) return features;
  EraseKeypoints(features, [&](size_t i) { return Covers(features.keypoints[i]); });
  return features;
}

void OwnBody::Restart(const CameraCalibration& camera) {
  camera_ = camera;
  grid_ = ImageCells(camera, kCellsAlong);
  cells_.assign(Index(grid_.num()), {});
  num_body_ = 0;
}

void OwnBody::SetMarks(const FeatureFrame& features) {
  marks_.clear();
  marked_us_ = looked_us_ = features.utime_us;
  const auto score_of = [&features](int i) {
    return i < 0 ? -1 : static_cast<int>(features.keypoints[Index(i)].score);
  };
  std::array<int, kMarksPerCell> none;
  none.fill(-1);
  std::vector<std::array<int, kMarksPerCell>> strongest(cells_.size(), none);  // keypoints by cell
  for (size_t i = 0; i < std::min(features.keypoints.size(), features.descriptors.size()); ++i) {
    auto last = static_cast<int>(i);
    for (int& kept : strongest[Index(CellOf(features.keypoints[i]))]) {
      if (score_of(last) > score_of(kept)) std::swap(last, kept);
    }
  }
  for (size_t cell = 0; cell < strongest.size(); ++cell) {
    for (const int i : strongest[cell]) {
      if (i < 0) break;
      const auto point = PointFromDepth(features, i);
      marks_.push_back({features.keypoints[Index(i)], features.descriptors[Index(i)], point ? point->z() : 0.0,
                        static_cast<int>(cell)});
    }
  }
}

std::vector<OwnBody::CellMarks> OwnBody::LookForMarks(const FeatureFrame& features) const {
  const FeatureGrid grid(features.keypoints, camera_.width_px, camera_.height_px);
  std::vector<CellMarks> cells(cells_.size());
  for (const Mark& mark : marks_) {
    const int level = mark.keypoint.level;
    const Eigen::Vector2d at(mark.keypoint.x_px, mark.keypoint.y_px);
    const double still_px = std::max(kStill_px, 0.5 * LevelScale(level));
    bool is_still = false, is_near = false;
    grid.VisitWindow(at, kNear_px, PatchRange::Levels(level - 1, level + 1), [&](const PlacedKeypoint& placed) {
      const bool is_there = (Eigen::Vector2d(placed.x_px, placed.y_px) - at).norm() <= still_px;
      const int distance = HammingDistance(features.descriptors[Index(placed.index)], mark.descriptor);
      is_still |= is_there && distance <= kMaxStillDistance;
      is_near |= distance <= kMaxDistance;
    });
    CellMarks& cell = cells[Index(mark.cell)];
    ++cell.num;
    cell.num_still += is_still ? 1 : 0;
    cell.num_near += is_near && !is_still ? 1 : 0;
    if (cell.depth_m == 0.0) cell.depth_m = mark.depth_m;
  }
  return cells;
}

OwnBody::Scene OwnBody::Judge(const std::vector<CellMarks>& marks) const {
  Scene scene;
  int num = 0, num_still = 0, num_still_scene = 0;
  for (size_t i = 0; i < marks.size(); ++i) {
    num += marks[i].num > 0 ? 1 : 0;
    if (marks[i].IsStill()) {
      ++num_still;
      num_still_scene += cells_[i].score <= kSceneScore ? 1 : 0;
    } else if (marks[i].HasGone()) {
      ++scene.num_gone;
      if (marks[i].depth_m > 0.0) scene.gone_depths_m.push_back(marks[i].depth_m);
    }
  }
  std::ranges::sort(scene.gone_depths_m);
  scene.stands = 2 * num_still_scene > num_still;
  const int num_near = num - num_still - scene.num_gone;
  scene.turns = num_near <= kMaxNear * num && num_still <= kMaxStill * num;
  return scene;
}

void OwnBody::Count(const std::vector<CellMarks>& marks, const Scene& scene) {
  std::vector<size_t> nearest;
  for (size_t i = 0; i < marks.size(); ++i) {
    int& score = cells_[i].score;
    score -= kGoneLoss * (marks[i].num - marks[i].num_still);
    if (scene.Contradicts(marks[i].depth_m)) {
      score += kStillGain * marks[i].num_still;
      if (marks[i].IsStill() && scene.IsNearerThanMost(marks[i].depth_m)) nearest.push_back(i);
    } else if (!scene.stands && score < 0) {
      score = std::min(score + kOpenGain * marks[i].num_still, 0);
    }
    score = std::clamp(score, kMinScore, kMaxScore);
  }
  if (nearest.size() < kPlain) return;
  for (const size_t i : nearest) cells_[i].score = std::min(cells_[i].score + kBodyScore, kMaxScore);
}

// Cells that stand still in groups of three; fewer than kMinCells in all are there by chance. Where no keypoint has
// been so far, it is as around.
void OwnBody::FindBody() {
  std::vector<uint8_t> is_still(cells_.size()), is_inside(cells_.size()), is_body(cells_.size());
  for (size_t i = 0; i < cells_.size(); ++i) is_still[i] = cells_[i].score >= kBodyScore ? 1 : 0;
  for (int i = 0; i < grid_.num(); ++i) {
    int num = 0;
    grid_.VisitAround(i, [&](size_t neighbor) { num += is_still[neighbor]; });
    const bool may_be = is_still[Index(i)] != 0 || cells_[Index(i)].score == 0;
    is_inside[Index(i)] = may_be && num >= 3 ? 1 : 0;
  }
  for (int i = 0; i < grid_.num(); ++i) {
    bool is_beside = false;
    grid_.VisitAround(i, [&](size_t neighbor) { is_beside |= is_inside[neighbor] != 0; });
    is_body[Index(i)] = is_inside[Index(i)] != 0 || (is_still[Index(i)] != 0 && is_beside) ? 1 : 0;
  }
  num_body_ = static_cast<int>(std::ranges::count(is_body, 1));
  if (num_body_ < kMinCells) num_body_ = 0;
  for (size_t i = 0; i < cells_.size(); ++i) {
    Cell& cell = cells_[i];
    cell.is_body = num_body_ > 0 && is_body[i] != 0;
    num_found_ += cell.is_body && !cell.was_body ? 1 : 0;
    cell.was_body |= cell.is_body;
  }
}

std::vector<LandmarkId> LandmarksOn(const OwnBody& body, const Map& map) {
  std::vector<LandmarkId> found;
  map.landmarks().ForEach([&](LandmarkId id, const auto&) {
    const std::span<const Observation> observations = map.ObservationsOf(id);
    const bool is_on_body = std::ranges::all_of(observations, [&](const Observation& observation) {
      const FeatureFrame& features = *map.FindKeyframe(observation.keyframe)->features;
      return body.Covers(features.keypoints[static_cast<size_t>(observation.keypoint)]);
    });
    if (is_on_body && !observations.empty()) found.push_back(id);
  });
  return found;
}

}  // namespace tessera
