#include "tracking/initializer.h"

#include <utility>

#include "core/quantile.h"

namespace tessera {
namespace {

// Scales lengths so that the median depth of the points becomes 1.
void NormalizeDepth(MonoStart& start) {
  std::vector<double> depths;
  for (const MonoStart::Point& point : start.points) {
    depths.push_back(point.point.point_in_world.z());
  }
  const double scale = 1.0 / OrderStatistic(std::move(depths), 0.5);
  start.second_from_first.translation *= scale;
  for (MonoStart::Point& point : start.points) {
    point.point.point_in_world *= scale;
    point.point.covariance *= scale * scale;
  }
}

}  // namespace

Result<> InitializerOptions::Check() const {
  if (!(radius_share > 0.0) || min_matches < 8 || max_frames < 1) {
    return Failed("the options of mono initialization must be positive, and min_matches at least 8");
  }
  return two_view.Check();
}

std::optional<MonoStart> MonoInitializer::Add(const std::shared_ptr<const FrameView>& frame) {
  if (reference_ == nullptr ||
      frame->features().frame.value - reference_->features().frame.value > options_.max_frames) {
    SetReference(frame);
    return std::nullopt;
  }
  const double radius_px = options_.radius_share * frame->calibration().longer_side_px();
  const std::vector<Match> matches = MatchInWindow(*reference_, last_seen_px_, *frame, radius_px, options_.matching);
  if (static_cast<int>(matches.size()) < options_.min_matches) {
    SetReference(frame);
    return std::nullopt;
  }
  std::vector<PixelPair> pairs;
  for (const Match& match : matches) {
    last_seen_px_[static_cast<size_t>(match.first)] = frame->pixel(match.second);
    pairs.push_back({reference_->pixel(match.first), frame->pixel(match.second)});
  }
  const auto seed = static_cast<uint64_t>(frame->features().frame.value);
  const auto views = EstimateTwoView(frame->calibration(), pairs, seed, options_.two_view, guesses_);
  if (views) {
    guesses_ = {views->second_from_first};
  }
  if (!views || !views->is_clear) {
    return std::nullopt;
  }
  MonoStart start = MakeStart(frame, matches, *views);
  if (static_cast<int>(start.points.size()) < options_.two_view.min_points) {
    return std::nullopt;
  }
  NormalizeDepth(start);
  return start;
}

void MonoInitializer::SetReference(const std::shared_ptr<const FrameView>& frame) {
  reference_ = frame->size() >= options_.min_matches ? frame : nullptr;
  last_seen_px_.clear();
  guesses_.clear();
  for (int i = 0; i < frame->size(); ++i) {
    last_seen_px_.push_back(frame->pixel(i));
  }
}

MonoStart MonoInitializer::MakeStart(const std::shared_ptr<const FrameView>& frame, const std::vector<Match>& matches,
                                     const TwoViewResult& views) const {
  MonoStart start{reference_, frame, views.second_from_first, {}};
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!views.points[i]) {
      continue;
    }
    const std::vector<PointView> seen = {{Rigid3::Identity(), reference_->observation(matches[i].first)},
                                         {views.second_from_first, frame->observation(matches[i].second)}};
    const auto refined = RefinePoint(frame->calibration(), 0.0, seen, *views.points[i]);
    if (refined && refined->max_chi2 <= Chi2Limit(false)) {
      start.points.push_back({matches[i].first, matches[i].second, *refined});
    }
  }
  return start;
}

}  // namespace tessera
