#include "tracking/pair_motion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "measurement/keypoint_measurement.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

// In front of the last frame's camera, by the known point that it sees there or by what it measured itself; nullopt:
// neither.
std::optional<double> DepthInLast(const TrackedFrame& last, const Rigid3& last_from_world, int32_t keypoint) {
  const SeenPoint& known = last.points[Index(keypoint)];
  if (known.valid() && HasDepth(known.landmark, last.world_from_camera.translation)) {
    return (last_from_world * known.landmark.position_in_world).z();
  }
  const std::optional<Eigen::Vector3d> measured = PointFromDepth(last.view->features(), keypoint);
  return measured ? std::optional(measured->z()) : std::nullopt;
}

// How long the step is by each point that both frames see and whose depth is known.
std::vector<double> StepLengths(const TrackedFrame& last, const std::vector<Match>& matches,
                                const TwoViewResult& views) {
  const Rigid3 last_from_world = last.world_from_camera.Inverse();
  std::vector<double> lengths;
  for (size_t k = 0; k < matches.size(); ++k) {
    if (!views.points[k]) continue;
    const std::optional<double> depth = DepthInLast(last, last_from_world, matches[k].first);
    if (depth) lengths.push_back(*depth / views.points[k]->z());
  }
  std::sort(lengths.begin(), lengths.end());
  return lengths;
}

// Their median; nullopt if they are few or disagree.
std::optional<double> CommonLength(const std::vector<double>& lengths, const PairMotionOptions& options) {
  if (static_cast<int>(lengths.size()) < options.min_known_points) return std::nullopt;
  const double median = lengths[lengths.size() / 2];
  const auto agrees = [&](double length) { return std::abs(length / median - 1.0) <= options.max_depth_spread; };
  const auto num_agreeing = static_cast<size_t>(std::count_if(lengths.begin(), lengths.end(), agrees));
  return 2 * num_agreeing >= lengths.size() ? std::optional(median) : std::nullopt;
}

TwoViewOptions WithPrior(const PairMotionOptions& options, const std::optional<DirectionPrior>& expected) {
  TwoViewOptions two_view = options.two_view;
  if (!expected) return two_view;
  two_view.max_direction_sigma_rad = options.max_direction_sigma_rad;
  two_view.prior = {expected->way, std::max(options.min_expected_sigma_rad, expected->sigma_rad)};
  return two_view;
}

// The cosine between a step of length 1 and where it is expected to go.
double CosExpected(const Rigid3& second_from_first, const DirectionPrior& expected) {
  return second_from_first.translation.dot(expected.DirectionFor(second_from_first.rotation));
}

}  // namespace

Result<> PairMotionOptions::Check() const {
  if (min_known_points < 1 || !(max_depth_spread > 0.0)) {
    return Failed("the length of a step needs at least one known point and a positive spread");
  }
  if (!(max_direction_sigma_rad > 0.0) || !(min_expected_sigma_rad > 0.0)) {
    return Failed("the direction of a step needs standard deviations above 0");
  }
  return two_view.Check();
}

std::optional<Rigid3> EstimatePairMotion(const TrackedFrame& last, const FrameView& current,
                                         const std::optional<DirectionPrior>& expected,
                                         const PairMotionOptions& options) {
  std::vector<Eigen::Vector2d> centers_px;
  for (int i = 0; i < last.view->size(); ++i) centers_px.push_back(last.view->pixel(i));
  const double radius_px = std::hypot(current.calibration().width_px, current.calibration().height_px);
  const std::vector<Match> matches = MatchInWindow(*last.view, centers_px, current, radius_px, options.matching);
  std::vector<PixelPair> pairs;
  for (const Match& match : matches) pairs.push_back({last.view->pixel(match.first), current.pixel(match.second)});
  const auto seed = static_cast<uint64_t>(current.features().frame.value);
  const auto views = EstimateTwoView(current.calibration(), pairs, seed, WithPrior(options, expected));
  if (!views || !views->is_clear) return std::nullopt;
  const std::optional<double> length = CommonLength(StepLengths(last, matches, *views), options);
  Rigid3 last_from_current = views->second_from_first.Inverse();
  if (length) {
    last_from_current.translation *= *length;
  } else if (expected && CosExpected(views->second_from_first, *expected) > options.min_cos_expected) {
    last_from_current.translation *= expected->way.norm();
  } else {
    return std::nullopt;
  }
  return last_from_current;
}

}  // namespace tessera
