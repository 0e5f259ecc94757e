#include "features/extractor.h"

#include <stdexcept>

#include "features/selection.h"
#include "features/tiling.h"

namespace tessera {
namespace {

// Nearest level-0 pixel of the candidate.
float DepthAt(const TileJob& job, const Candidate& candidate) {
  const int x = LevelZeroEdge(2 * candidate.x + 1, candidate.level) - job.depth_rect.x;
  const int y = LevelZeroEdge(2 * candidate.y + 1, candidate.level) - job.depth_rect.y;
  return static_cast<float>(job.depth.row(y)[x] * job.calibration.depth_unit_m);
}

Rect Grow(const Rect& rect, int margin) {
  return {
      .x = rect.x - margin, .y = rect.y - margin, .width = rect.width + 2 * margin, .height = rect.height + 2 * margin};
}

bool IsWholeImage(const TileJob& job) {
  return job.first_level == 0 && job.last_level == job.options.num_levels - 1 &&
         job.core == Rect{0, 0, job.calibration.width_px, job.calibration.height_px};
}

}  // namespace

TileFeatures Extractor::Extract(const TileJob& job) {
  ThrowIfFailed<std::invalid_argument>(CheckTileJob(job));
  plan_ = PlanTile(job.calibration, job.options, job.core, job.first_level, job.last_level);
  BuildPyramids(job);
  DetectCandidates(job);

  TileFeatures features{.run = job.run,
                        .frame = job.frame,
                        .previous_frame = job.previous_frame,
                        .utime_us = job.utime_us,
                        .captured_us = job.captured_us,
                        .depth_delay_us = job.depth_delay_us,
                        .tile = job.tile,
                        .num_tiles = job.num_tiles,
                        .calibration = job.calibration,
                        .options = job.options,
                        .cuts = cuts_,
                        .candidates = {},
                        .descriptors = {}};
  DescribeCandidates(features);
  if (job.calibration.sensor == SensorType::kStereo) MatchCandidates(job.options);
  if (job.calibration.sensor == SensorType::kRgbd) {
    for (Candidate& candidate : candidates_) candidate.depth_m = DepthAt(job, candidate);
  }
  features.candidates = candidates_;
  return features;
}

void Extractor::BuildPyramids(const TileJob& job) {
  const bool is_stereo = job.calibration.sensor == SensorType::kStereo;
  const auto first = static_cast<size_t>(job.first_level);
  CopyRegion(job.left, job.left_rect, plan_.levels[first].left, left_[first]);
  if (is_stereo) CopyRegion(job.right, job.right_rect, plan_.levels[first].right, right_[first]);
  for (size_t level = first + 1; level <= static_cast<size_t>(job.last_level); ++level) {
    left_[level].Reset(plan_.levels[level].left);
    reducer_.Reduce(left_[level - 1], left_[level]);
    if (!is_stereo) continue;
    right_[level].Reset(plan_.levels[level].right);
    reducer_.Reduce(right_[level - 1], right_[level]);
  }
}

void Extractor::DetectCandidates(const TileJob& job) {
  candidates_.clear();
  cuts_.clear();
  for (int level = job.first_level; level <= job.last_level; ++level) {
    const auto l = static_cast<size_t>(level);
    const LevelPlan& plan = plan_.levels[l];
    const int capacity = CellCapacity(job.options, level, plan.width, plan.height);
    if (plan.corners.empty()) continue;
    smoother_.Smooth(left_[l], Grow(plan.corners, kPatchRadiusPx + 2), 1, smoothed_[l]);
    detector_.Detect(smoothed_[l], plan, level, job.options.min_score, capacity, candidates_);
  }
  if (!IsWholeImage(job)) {
    if (!job.min_priority.empty()) cuts_ = LeaveOutBelow(job.min_priority, job.calibration, candidates_);
    return;
  }
  // Nothing of the image is missing, so those that will not be selected need no descriptor.
  std::vector<Candidate> chosen;
  for (const uint32_t index : ChooseCandidates(job.calibration, job.options, candidates_)) {
    chosen.push_back(candidates_[index]);
  }
  candidates_.swap(chosen);
}

void Extractor::DescribeCandidates(TileFeatures& features) {
  int smoothed_level = -1;
  features.descriptors.reserve(candidates_.size());
  for (Candidate& candidate : candidates_) {  // level after level
    const auto level = static_cast<size_t>(candidate.level);
    if (candidate.level != smoothed_level) {
      smoothed_level = candidate.level;
      smoother_.Smooth(smoothed_[level], Grow(plan_.levels[level].corners, kPatchRadiusPx), 2, doubly_smoothed_);
    }
    candidate.angle = Orientation(smoothed_[level], candidate.x, candidate.y);
    features.descriptors.push_back(Describe(doubly_smoothed_, candidate.x, candidate.y, candidate.angle));
  }
}

void Extractor::MatchCandidates(const FeatureOptions& options) {
  for (Candidate& candidate : candidates_) {
    const auto level = static_cast<size_t>(candidate.level);
    const std::optional<StereoMatch> match = matcher_.Match(left_[level], right_[level], candidate.x, candidate.y,
                                                            candidate.y, LevelDisparity(options, candidate.level));
    if (!match) continue;
    // The disparity is that of the pixel; the corner beside it is seen as far beside in both images.
    const double corner_x = static_cast<double>(match->position) / StereoMatcher::kSubpixels +
                            static_cast<double>(candidate.offset_x) / kCornerSubpixels;
    candidate.right_x_px = LevelZeroPosition(corner_x, candidate.level);
  }
}

}  // namespace tessera
