#include "optimization/long_tracks.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/ids.h"

namespace tessera {
namespace {

double Distance(const BundleProblem& problem, const BundleObservation& observation) {
  const Rigid3& camera_from_world = problem.poses[Index(observation.pose)].camera_from_world;
  return (camera_from_world * problem.points[Index(observation.point)].position_in_world).norm();
}

}  // namespace

void SplitLongTracks(int max_observers, BundleProblem& problem) {
  std::vector<std::vector<size_t>> tracks(problem.points.size());  // by point: its observations
  for (size_t i = 0; i < problem.observations.size(); ++i) tracks[Index(problem.observations[i].point)].push_back(i);
  for (size_t point = 0; point < tracks.size(); ++point) {
    const size_t num_groups = (tracks[point].size() + Index(max_observers) - 1) / Index(max_observers);
    if (num_groups < 2) continue;
    std::vector<std::pair<double, size_t>> by_distance;
    for (const size_t i : tracks[point]) by_distance.emplace_back(Distance(problem, problem.observations[i]), i);
    std::ranges::sort(by_distance);
    for (size_t group = 1; group < num_groups; ++group) {
      const size_t begin = group * by_distance.size() / num_groups, end = (group + 1) * by_distance.size() / num_groups;
      const BundlePoint copy = problem.points[point];
      problem.points.push_back(copy);
      for (size_t k = begin; k < end; ++k) {
        problem.observations[by_distance[k].second].point = static_cast<int>(problem.points.size()) - 1;
      }
    }
  }
}

}  // namespace tessera
