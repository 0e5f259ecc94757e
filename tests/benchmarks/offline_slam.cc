// The whole of mapping without the bus: reads a data set, extracts, tracks and maps in one thread, with the deltas
// taken in logical time, and tells accuracy and the time of each step.
//
//   offline_slam SOURCE SENSOR OUT_DIR [LAST_FRAME] [MAP_DELAY_FRAMES]
//   offline_slam kitti:../shared/data/kitti/sequences/03 mono /tmp/k03
//
// OUT_DIR gets trajectory.txt (after all optimisation), trajectory_live.txt and ground_truth.txt, TUM rows each.
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <vector>

#include "core/errors.h"
#include "datasets/frame_source.h"
#include "evaluation/pose_text.h"
#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "stages/mapper/mapper.h"
#include "tracking/delta_schedule.h"
#include "tracking/map_tracker.h"

namespace tessera {
namespace {

struct Times {
  template <class Step>
  auto Measure(Step step) {
    const auto begin = std::chrono::steady_clock::now();
    auto result = step();
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    return result;
  }
  void Print(const char* name) {
    if (ms.empty()) return;
    std::sort(ms.begin(), ms.end());
    const size_t last = ms.size() - 1;
    std::printf("%-10s steps %zu median %.1f ms p95 %.1f ms max %.1f ms\n", name, ms.size(), ms[last / 2],
                ms[last * 95 / 100], ms[last]);
  }
  std::vector<double> ms;
};

struct Run {
  Times extract_times, track_times, map_times;
  std::vector<PoseEstimate> poses;
  Mapper mapper{MapperOptions{}};
  int num_lost = 0;
  int num_failures = 0;  // changes from tracked to lost
};

FeatureFrame ExtractAll(const CameraFrame& frame, const CameraCalibration& calibration, Extractor& extractor) {
  std::vector<TileFeatures> tiles;
  for (const TileJob& job : CutFrame(frame, calibration, 0, TileGrid{1, 1}, kMaxLevels, FeatureOptions{})) {
    tiles.push_back(extractor.Extract(job));
  }
  return SelectFeatures(tiles);
}

void Play(FrameSource& source, int64_t map_delay_frames, Run& run) {
  Extractor extractor;
  MapTracker tracker{MapTrackerOptions{}};
  DeltaSchedule schedule(map_delay_frames);
  bool was_lost = false;
  while (const auto frame = source.Next()) {
    const FeatureFrame features =
        run.extract_times.Measure([&] { return ExtractAll(*frame, source.calibration(), extractor); });
    const MapTrackingResult result = run.track_times.Measure([&] {
      for (const auto& delta : schedule.Take(features.frame)) {
        if (const std::string problem = tracker.ApplyDelta(*delta); !problem.empty()) throw InputError(problem);
      }
      return tracker.Track(features);
    });
    run.poses.push_back(result.pose);
    const bool is_lost = result.pose.state == TrackingState::kLost;
    run.num_lost += is_lost ? 1 : 0;
    run.num_failures += is_lost && !was_lost ? 1 : 0;
    was_lost = is_lost;
    for (const KeyframeObservation& keyframe : result.keyframes) {
      schedule.KeyframeSent(keyframe.id, features.frame);
      schedule.Receive(std::make_shared<const MapDelta>(
          run.map_times.Measure([&] { return run.mapper.Process(keyframe); })));
    }
  }
}

// RMS distance [m] of positions by frame from the true ones after the best alignment.
double RmsError(const std::map<FrameId, Rigid3>& estimate, const std::vector<GroundTruthPose>& truth,
                bool with_scale) {
  const auto max_num = static_cast<Eigen::Index>(truth.size());
  Eigen::MatrixXd a(3, max_num), b(3, max_num);
  Eigen::Index num = 0;
  for (const GroundTruthPose& pose : truth) {
    const auto found = estimate.find(pose.frame);
    if (found == estimate.end()) continue;
    a.col(num) = found->second.translation;
    b.col(num++) = pose.world_from_camera.translation;
  }
  if (num < 3) return -1.0;
  a.conservativeResize(3, num);
  b.conservativeResize(3, num);
  const Eigen::MatrixXd b_from_a = Eigen::umeyama(a, b, with_scale);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < num; ++i) {
    const Eigen::Vector3d moved = b_from_a.topLeftCorner(3, 3) * a.col(i) + b_from_a.topRightCorner(3, 1);
    sum += (moved - b.col(i)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(num));
}

void Report(const FrameSource& source, Run& run, const std::filesystem::path& out_dir) {
  std::filesystem::create_directories(out_dir);
  std::ofstream live_file(out_dir / "trajectory_live.txt"), file(out_dir / "trajectory.txt");
  std::ofstream truth_file(out_dir / "ground_truth.txt");
  std::map<FrameId, Rigid3> live, optimized;
  for (const PoseEstimate& pose : run.poses) {
    if (pose.state != TrackingState::kTracked) continue;
    live[pose.frame] = pose.world_from_camera;
    live_file << TumRow(pose.utime_us, pose.world_from_camera);
    const auto reference = run.mapper.removed_keyframes().Find(run.mapper.map(), pose.reference_keyframe);
    if (!reference) continue;
    optimized[pose.frame] = *reference * pose.reference_from_camera;
    file << TumRow(pose.utime_us, optimized[pose.frame]);
  }
  for (const GroundTruthPose& pose : source.ground_truth()) {
    truth_file << TumRow(pose.utime_us, pose.world_from_camera);
  }
  const bool is_mono = source.calibration().sensor == SensorType::kMono;
  const Map& map = run.mapper.map();
  std::printf("frames %zu, tracked %zu from frame %ld, lost %d, failures %d\n", run.poses.size(), optimized.size(),
              optimized.empty() ? -1L : static_cast<long>(optimized.begin()->first.value), run.num_lost,
              run.num_failures);
  std::printf("keyframes made %zu, kept %ld, landmarks %ld, map %s\n", run.map_times.ms.size(),
              static_cast<long>(map.keyframes().size()), static_cast<long>(map.landmarks().size()),
              map.Sha256Hex().c_str());
  std::printf("RMS error %.4f m, live %.4f m\n", RmsError(optimized, source.ground_truth(), is_mono),
              RmsError(live, source.ground_truth(), is_mono));
  run.extract_times.Print("extraction");
  run.track_times.Print("tracker");
  run.map_times.Print("mapper");
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr << "usage: offline_slam SOURCE SENSOR OUT_DIR [LAST_FRAME] [MAP_DELAY_FRAMES]\n";
    return 2;
  }
  try {
    tessera::SourceOptions options;
    options.source = argv[1];
    options.sensor = tessera::ParseSensor(argv[2]);
    options.last_frame = argc > 4 ? std::stoll(argv[4]) : -1;
    const auto source = tessera::OpenSource(options);
    tessera::Run run;
    tessera::Play(*source, argc > 5 ? std::stoll(argv[5]) : 3, run);
    tessera::Report(*source, run, argv[3]);
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return 0;
}
