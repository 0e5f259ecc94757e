#include "loop_closing/loop_correction.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "loop_closing/gap_motion.h"
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

// Where the part that began later moves, as a whole, so that the two agree at the loop:
// C = world_from_matched * matched_from_current * current_from_world, or its inverse.
Sim3 JoiningMove(const Map& map, KeyframeId current, const VerifiedPlace& place, bool moves_current) {
  const Sim3 matched_world_from_current_world =
      PoseOf(map, place.matched) * place.matched_from_current * PoseOf(map, current).Inverse();
  return moves_current ? matched_world_from_current_world : matched_world_from_current_world.Inverse();
}

// A node for each keyframe of the part, moved by new_from_old, and its links.
void AddPart(const Map& map, const std::vector<KeyframeId>& part, const Sim3& new_from_old, int min_shared,
             PoseGraphProblem& problem, std::map<KeyframeId, int>& node_of) {
  std::map<KeyframeId, int> in_part;
  for (const KeyframeId id : part) {
    in_part[id] = static_cast<int>(problem.nodes.size());
    problem.nodes.push_back({id, new_from_old * PoseOf(map, id)});
  }
  const std::vector<KeyframePair> links = EssentialLinks(map, in_part, min_shared);
  const MedianDepths depths = MedianDepthsOf(map, part);
  const std::vector<Matrix7> covariances = LinkCovariances(map, part, links, depths);
  for (size_t i = 0; i < links.size(); ++i) {
    const auto [older, newer] = links[i];
    problem.edges.push_back({in_part[newer], in_part[older], PoseOf(map, older).Inverse() * PoseOf(map, newer), 1.0,
                             depths.at(newer), covariances[i]});
  }
  node_of.merge(in_part);
}

// Where one part ends and the other continues, the camera moved on: weak links, which close the ring that a loop
// between two parts makes.
void AddGaps(const Map& map, const std::map<KeyframeId, int>& node_of, const std::set<KeyframeId>& first_part,
             PoseGraphProblem& problem) {
  std::vector<KeyframeId> ids;
  for (const auto& [id, node] : node_of) ids.push_back(id);
  for (size_t i = 2; i + 1 < ids.size(); ++i) {
    const auto is_first = [&](size_t k) { return first_part.contains(ids[k]); };
    if (is_first(i - 1) == is_first(i) || is_first(i - 2) != is_first(i - 1) || is_first(i) != is_first(i + 1)) {
      continue;
    }
    const Keyframe& after = *map.FindKeyframe(ids[i]);
    const std::optional<GapMotion> gap = MotionAcrossGap(*map.FindKeyframe(ids[i - 2]), *map.FindKeyframe(ids[i - 1]),
                                                         after, *map.FindKeyframe(ids[i + 1]));
    if (!gap) continue;
    problem.edges.push_back({node_of.at(ids[i]), node_of.at(ids[i - 1]), gap->before_from_after, 1.0,
                             MedianDepth(map, after), gap->covariance});
  }
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
  const KeyframeId current_root = RootOf(map, current), matched_root = RootOf(map, place.matched);
  const std::vector<KeyframeId> older_part = MapPartOf(map, std::min(current_root, matched_root));
  std::map<KeyframeId, int> node_of;
  AddPart(map, older_part, Sim3{}, options.min_shared_landmarks, problem, node_of);
  if (current_root != matched_root) {
    const Sim3 new_from_old = JoiningMove(map, current, place, current_root > matched_root);
    AddPart(map, MapPartOf(map, std::max(current_root, matched_root)), new_from_old, options.min_shared_landmarks,
            problem, node_of);
    AddGaps(map, node_of, {older_part.begin(), older_part.end()}, problem);
  }
  problem.nodes[static_cast<size_t>(node_of[std::min(current_root, matched_root)])].is_fixed = true;
  problem.edges.push_back({node_of[current], node_of[place.matched], place.matched_from_current, options.loop_weight,
                           MedianDepth(map, *map.FindKeyframe(current))});
  return problem;
}

std::optional<LoopCorrection> ComputeCorrection(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                                const CorrectionOptions& options) {
  const PoseGraphProblem problem = BuildEssentialGraph(map, current, place, options);
  const std::optional<std::vector<Sim3>> solved = OptimizePoseGraph(problem, options.graph);
  if (!solved) return std::nullopt;
  LoopCorrection correction;
  for (size_t i = 0; i < problem.nodes.size(); ++i) {
    correction.keyframes.push_back({problem.nodes[i].id, (*solved)[i] * PoseOf(map, problem.nodes[i].id).Inverse()});
  }
  std::ranges::sort(correction.keyframes, {}, &LoopResult::Correction::id);
  correction.contradiction_sigmas = std::sqrt(2.0 * PoseGraphCostAt(*solved, problem, options.graph));
  return correction;
}

}  // namespace tessera
