#include "loop_closing/loop_correction.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "loop_closing/link_covariance.h"
#include "map/spanning_tree.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

Sim3 PoseOf(const Map& map, KeyframeId id) { return Sim3::From(map.FindKeyframe(id)->world_from_camera); }

// Pairs of keyframes of the part that an edge joins, the older one first.
std::vector<KeyframePair> EssentialLinks(const Map& map, const std::map<KeyframeId, int>& node_of, int min_shared) {
  std::set<std::pair<KeyframeId, KeyframeId>> pairs;
  const auto add = [&](KeyframeId a, KeyframeId b) {
    if (node_of.contains(a) && node_of.contains(b)) pairs.insert(std::minmax(a, b));
  };
  for (const auto& [id, node] : node_of) {
    const Keyframe& keyframe = *map.FindKeyframe(id);
    add(id, keyframe.parent);
    for (const auto& [other, num_shared] : keyframe.covisible) {
      if (num_shared >= min_shared) add(id, other);
    }
  }
  for (const ClosedLoop& loop : map.closed_loops()) add(loop.current, loop.matched);
  std::vector<KeyframePair> links;
  for (const auto& [older, newer] : pairs) links.push_back({older, newer});
  return links;
}

// The part that began later moves: C = world_from_matched * matched_from_current * current_from_world, or its inverse.
std::vector<LoopResult::Correction> JoinParts(const Map& map, KeyframeId current, const VerifiedPlace& place) {
  const Sim3 matched_world_from_current_world =
      PoseOf(map, place.matched) * place.matched_from_current * PoseOf(map, current).Inverse();
  const bool moves_current = RootOf(map, current) > RootOf(map, place.matched);
  const Sim3 new_from_old =
      moves_current ? matched_world_from_current_world : matched_world_from_current_world.Inverse();
  std::vector<LoopResult::Correction> corrections;
  for (const KeyframeId id : MapPartOf(map, moves_current ? current : place.matched)) {
    corrections.push_back({id, new_from_old});
  }
  return corrections;
}

}  // namespace

Result<> CorrectionOptions::Check() const {
  if (min_shared_landmarks < 1 || !(loop_weight > 0.0)) return Failed("the loop closer's graph needs positive weights");
  return graph.Check();
}

PoseGraphProblem BuildEssentialGraph(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                     const CorrectionOptions& options) {
  PoseGraphProblem problem;
  problem.has_scale = map.FindKeyframe(current)->features->calibration.sensor == SensorType::kMono;
  const KeyframeId root = RootOf(map, current);
  const std::vector<KeyframeId> part = MapPartOf(map, current);
  std::map<KeyframeId, int> node_of;
  for (const KeyframeId id : part) {
    node_of[id] = static_cast<int>(problem.nodes.size());
    problem.nodes.push_back({id, PoseOf(map, id), id == root});
  }
  const std::vector<KeyframePair> links = EssentialLinks(map, node_of, options.min_shared_landmarks);
  const std::vector<Matrix7> covariances = LinkCovariances(map, part, links);
  for (size_t i = 0; i < links.size(); ++i) {
    const auto [older, newer] = links[i];
    problem.edges.push_back({node_of[newer], node_of[older], PoseOf(map, older).Inverse() * PoseOf(map, newer), 1.0,
                             MedianDepth(map, *map.FindKeyframe(newer)), covariances[i]});
  }
  problem.edges.push_back({node_of[current], node_of[place.matched], place.matched_from_current, options.loop_weight,
                           MedianDepth(map, *map.FindKeyframe(current))});
  return problem;
}

std::vector<LoopResult::Correction> ComputeCorrections(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                                       const CorrectionOptions& options) {
  if (RootOf(map, current) != RootOf(map, place.matched)) return JoinParts(map, current, place);
  const PoseGraphProblem problem = BuildEssentialGraph(map, current, place, options);
  const std::optional<std::vector<Sim3>> solved = OptimizePoseGraph(problem, options.graph);
  std::vector<LoopResult::Correction> corrections;
  for (size_t i = 0; solved && i < problem.nodes.size(); ++i) {
    const PoseGraphNode& node = problem.nodes[i];
    corrections.push_back({node.id, (*solved)[i] * node.world_from_keyframe.Inverse()});
  }
  return corrections;
}

}  // namespace tessera
