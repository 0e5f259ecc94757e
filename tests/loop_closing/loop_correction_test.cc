// How a loop's error is spread over a map.
#include "loop_closing/loop_correction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <numbers>
#include <vector>

#include "map/map_editor.h"
#include "map/spanning_tree.h"
#include "mapping/map_correction.h"
#include "support/synthetic_problems.h"

namespace tessera {
namespace {

std::shared_ptr<const FeatureFrame> FeaturesOf(int64_t frame, SensorType sensor) {
  auto features = std::make_shared<FeatureFrame>();
  features->frame = {frame};
  features->calibration.sensor = sensor;
  return features;
}

// The circuit as odometry left it, a chain of keyframes that see nothing.
Map MapOf(const SyntheticCircuit& circuit, SensorType sensor) {
  Map map;
  MapEditor editor(map);
  for (const PoseGraphNode& node : circuit.problem.nodes) {
    editor.AddKeyframe(node.id, {node.id.value - 1}, Sim3::From(node.world_from_keyframe.Pose()),
                       FeaturesOf(node.id.value, sensor));
  }
  (void)editor.Finish(circuit.problem.nodes.back().id);
  return map;
}

VerifiedPlace LoopOf(const SyntheticCircuit& circuit) { return {{0}, circuit.problem.edges.back().to_from_from, {}}; }

Sim3 PoseOf(const Map& map, int64_t keyframe) { return map.FindKeyframe({keyframe})->WorldFromKeyframe(); }

std::vector<Sim3> KeyframePoses(const Map& map) {
  std::vector<Sim3> poses;
  map.keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) { poses.push_back(keyframe.WorldFromKeyframe()); });
  return poses;
}

TEST(LoopCorrection, SpreadsTheErrorOfALoopOverTheRing) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticCircuitOptions options;
    options.num_keyframes = 120;
    options.has_scale = sensor == SensorType::kMono;
    options.log_scale_drift = options.has_scale ? 0.3 : 0.0;
    const SyntheticCircuit circuit = MakeSyntheticCircuit(options);
    Map map = MapOf(circuit, sensor);
    const std::vector<Sim3> before = KeyframePoses(map);
    const KeyframeId current{119};
    const VerifiedPlace place = LoopOf(circuit);
    const auto corrections = ComputeCorrection(map, current, place, {}).value().keyframes;
    ASSERT_EQ(corrections.size(), 120U);
    Corrections by_keyframe;
    for (size_t i = 0; i < corrections.size(); ++i) {
      EXPECT_EQ(corrections[i].id, KeyframeId{static_cast<int64_t>(i)});
      by_keyframe[corrections[i].id] = corrections[i].new_world_from_old;
      if (!options.has_scale) {
        EXPECT_NEAR(corrections[i].new_world_from_old.scale, 1.0, 1e-12);
      }
    }
    MapEditor editor(map);
    ApplyCorrections(by_keyframe, editor);
    (void)editor.Finish(current);
    const std::vector<Sim3> after = KeyframePoses(map);
    EXPECT_LT((after[0].translation - before[0].translation).norm(), 1e-12) << "the root stays";
    EXPECT_LT(CircuitError(circuit, after, 1.0), 0.4 * CircuitError(circuit, before, 1.0)) << ToString(sensor);
    // The ends meet, and no step gives way by more than a few parts of a hundred.
    const Sim3 gap = place.matched_from_current.Inverse() * (after[0].Inverse() * after[119]);
    EXPECT_LT(gap.translation.norm(), 0.5);
    EXPECT_NEAR(gap.scale, 1.0, 0.03);
    for (size_t i = 1; i < after.size(); ++i) {
      const Sim3 step = (before[i - 1].Inverse() * before[i]).Inverse() * (after[i - 1].Inverse() * after[i]);
      EXPECT_LT(step.translation.norm(), 0.1) << i;
      EXPECT_NEAR(step.scale, 1.0, 0.02) << i;
    }
  }
}

// The same loop, and one that says that the camera came back at a right angle.
TEST(LoopCorrection, TellsHowFarTheMapContradictsALoop) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticCircuitOptions options;
    options.num_keyframes = 120;
    options.has_scale = sensor == SensorType::kMono;
    const SyntheticCircuit circuit = MakeSyntheticCircuit(options);
    const Map map = MapOf(circuit, sensor);
    VerifiedPlace place = LoopOf(circuit);
    const double of_truth = ComputeCorrection(map, {119}, place, {}).value().contradiction_sigmas;
    EXPECT_GT(of_truth, 0.0);
    place.matched_from_current = Sim3{1.0, ExpSO3({0.0, std::numbers::pi / 2.0, 0.0}), {}} * place.matched_from_current;
    EXPECT_GT(ComputeCorrection(map, {119}, place, {}).value().contradiction_sigmas, 10.0 * of_truth)
        << ToString(sensor);
    place.matched_from_current = (PoseOf(map, 0).Inverse() * PoseOf(map, 119));
    EXPECT_NEAR(ComputeCorrection(map, {119}, place, {}).value().contradiction_sigmas, 0.0, 1e-3)
        << "what the map says itself";
  }
}

TEST(LoopCorrection, OldLoopsStayInTheGraph) {
  SyntheticCircuitOptions options;
  options.num_keyframes = 40;
  const SyntheticCircuit circuit = MakeSyntheticCircuit(options);
  Map map = MapOf(circuit, SensorType::kMono);
  const size_t num_before = BuildEssentialGraph(map, {39}, LoopOf(circuit), {}).edges.size();
  EXPECT_EQ(num_before, 39U + 1U) << "the tree and the new loop";
  MapEditor editor(map);
  editor.AddClosedLoop({{20}, {5}, 1.0, 50});
  editor.AddClosedLoop({{21}, {20}, 1.0, 50});  // an edge of the tree already
  (void)editor.Finish({39});
  const PoseGraphProblem problem = BuildEssentialGraph(map, {39}, LoopOf(circuit), {});
  EXPECT_EQ(problem.edges.size(), num_before + 1);
  EXPECT_TRUE(problem.Check());
  for (const PoseGraphNode& node : problem.nodes) EXPECT_EQ(node.is_fixed, node.id == KeyframeId{0});
  EXPECT_TRUE(problem.has_scale);
}

// Two parts: the one that began later moves as a whole, whichever of them the loop was found in.
TEST(LoopCorrection, JoinsTwoParts) {
  for (const bool is_found_in_later : {true, false}) {
    Map map;
    MapEditor editor(map);
    const auto pose = [](int64_t k) {
      return Rigid3{ExpSO3({0.0, 0.1 * static_cast<double>(k), 0.0}), {0.0, 0.0, static_cast<double>(k)}};
    };
    // 0 <- 1 <- 4 <- 5, and 2 <- 3: the older part was continued.
    const std::vector<int64_t> parents{-1, 0, -1, 2, 1, 4};
    for (int64_t k = 0; k < 6; ++k) {
      editor.AddKeyframe({k}, {parents[static_cast<size_t>(k)]}, Sim3::From(pose(k)), FeaturesOf(k, SensorType::kMono));
    }
    (void)editor.Finish({5});
    const KeyframeId current = is_found_in_later ? KeyframeId{3} : KeyframeId{5};
    const KeyframeId matched = is_found_in_later ? KeyframeId{1} : KeyframeId{3};
    const Sim3 measured{1.4, ExpSO3({0.0, 0.3, 0.1}), {0.5, 0.0, 0.2}};
    const auto corrections = ComputeCorrection(map, current, {matched, measured, {}}, {}).value().keyframes;
    ASSERT_EQ(corrections.size(), 6U);
    Corrections by_keyframe;
    for (size_t i = 0; i < corrections.size(); ++i) {
      EXPECT_EQ(corrections[i].id, KeyframeId{static_cast<int64_t>(i)});
      by_keyframe[corrections[i].id] = corrections[i].new_world_from_old;
    }
    MapEditor correction(map);
    ApplyCorrections(by_keyframe, correction);
    (void)correction.Finish({5});
    const Sim3 joined =
        map.FindKeyframe(matched)->WorldFromKeyframe().Inverse() * map.FindKeyframe(current)->WorldFromKeyframe();
    EXPECT_NEAR(joined.scale, measured.scale, 1e-12);
    EXPECT_LT((joined.translation - measured.translation).norm(), 1e-9);
    EXPECT_LT(joined.rotation.angularDistance(measured.rotation), 1e-7);
    for (const int64_t k : {0, 1, 4, 5}) {
      EXPECT_LT((map.FindKeyframe({k})->world_from_camera.translation - pose(k).translation).norm(), 1e-9);
    }
  }
}

// A camera that goes around a circuit at a constant speed is lost for a while; what it makes then has another scale and
// stands elsewhere. When it comes back to the start, the ring is closed across the gap.
TEST(LoopCorrection, AGapBetweenTwoPartsClosesTheRing) {
  const SyntheticCircuitOptions options{.num_keyframes = 120, .rotation_sigma_rad = 0.0005, .log_scale_drift = 0.3};
  const SyntheticCircuit circuit = MakeSyntheticCircuit(options);
  constexpr int64_t kGap = 60;
  for (const bool is_timed : {true, false}) {
    const Sim3 elsewhere{0.3, ExpSO3({0.2, -0.4, 0.1}), {50.0, 3.0, -20.0}};
    Map map;
    MapEditor editor(map);
    for (const PoseGraphNode& node : circuit.problem.nodes) {
      const int64_t k = node.id.value;
      auto features = std::make_shared<FeatureFrame>(*FeaturesOf(k, SensorType::kMono));
      features->utime_us = is_timed ? 200'000 * k : 0;
      const Sim3 pose = k < kGap ? node.world_from_keyframe : elsewhere * node.world_from_keyframe;
      editor.AddKeyframe(node.id, {k == kGap ? -1 : k - 1}, Sim3::From(pose.Pose()), features);
    }
    (void)editor.Finish({119});
    VerifiedPlace place = LoopOf(circuit);
    place.matched_from_current.scale /= elsewhere.scale;
    const auto corrections = ComputeCorrection(map, {119}, place, {}).value().keyframes;
    ASSERT_EQ(corrections.size(), 120U);
    std::vector<Sim3> joined;
    for (const LoopResult::Correction& correction : corrections) {
      joined.push_back(correction.new_world_from_old * map.FindKeyframe(correction.id)->WorldFromKeyframe());
    }
    const double apart = (joined[kGap].translation - joined[kGap - 1].translation).norm();
    const double step = (joined[kGap - 1].translation - joined[kGap - 2].translation).norm();
    if (is_timed) {
      EXPECT_LT(apart, 2.0 * step);
      EXPECT_GT(apart, 0.5 * step);
    } else {
      EXPECT_GT(apart, 2.0 * step) << "nothing is known of how far the camera went";
    }
  }
}

}  // namespace
}  // namespace tessera
