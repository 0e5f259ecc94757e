// The whole of mapping without the bus: reads a data set, extracts, tracks and maps in one thread, with the deltas
// taken in logical time, and tells accuracy and the CPU time of each step.
//
//   offline_slam SOURCE SENSOR OUT_DIR [first=0] [last=-1] [delay=3[,4...]] [features=2000] [mirror=0] [turn=0]
//   [reverse=0] [step=1] [focal_percent=0] [repeat=0] [jitter_ms=0] [dim=1] [dirt=0] [gaps=0] [min_focal=0]
//   [vocabulary=FILE]
//   offline_slam kitti:../shared/data/kitti/sequences/03 mono /tmp/k03 last=300
//
// With several delays, the sequence is played once with each; the spread tells what chance alone does to the errors.
// OUT_DIR, or its delay_N for each of several delays, gets figures.csv, frames.csv, trajectory.txt (after all
// optimization), trajectory_live.txt and ground_truth.txt, TUM rows each.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include "benchmarks/offline_run.h"
#include "core/errors.h"

namespace tessera {
namespace {

struct Arguments {
  SourceOptions source;
  FeatureOptions features;
  std::vector<int64_t> map_delays{3};  // frames
  Variation variation;
  std::string vocabulary;
};

std::vector<int64_t> ParseNumbers(const std::string& text) {
  std::vector<int64_t> numbers;
  std::istringstream stream(text);
  for (std::string number; std::getline(stream, number, ',');) numbers.push_back(std::stoll(number));
  return numbers;
}

Arguments ParseArguments(int argc, char** argv) {
  Arguments arguments;
  arguments.source.source = argv[1];
  arguments.source.sensor = ParseSensor(argv[2]);
  for (int i = 4; i < argc; ++i) {
    const std::string text = argv[i], key = text.substr(0, text.find('='));
    if (key == text) throw InputError("`" + text + "` is not key=value");
    if (key == "vocabulary") {
      arguments.vocabulary = text.substr(key.size() + 1);
      continue;
    }
    if (key == "delay") {
      arguments.map_delays = ParseNumbers(text.substr(key.size() + 1));
      continue;
    }
    const int64_t value = std::stoll(text.substr(key.size() + 1));
    if (key == "first")
      arguments.source.first_frame = value;
    else if (key == "last")
      arguments.source.last_frame = value;
    else if (key == "min_focal")
      arguments.source.min_focal_px = static_cast<double>(value);
    else if (key == "features")
      arguments.features.num_features = static_cast<int>(value);
    else if (key == "mirror")
      arguments.variation.is_mirrored = value != 0;
    else if (key == "reverse")
      arguments.variation.is_reversed = value != 0;
    else if (key == "turn")
      arguments.variation.quarter_turns = value;
    else if (key == "step")
      arguments.variation.step = value;
    else if (key == "focal_percent")
      arguments.variation.focal_error = 0.01 * static_cast<double>(value);
    else if (key == "repeat")
      arguments.variation.repeat = value;
    else if (key == "jitter_ms")
      arguments.variation.jitter_s = 1e-3 * static_cast<double>(value);
    else if (key == "dim")
      arguments.variation.dim = value;
    else if (key == "dirt")
      arguments.variation.dirt = value;
    else if (key == "gaps")
      arguments.variation.gaps = value;
    else
      throw InputError("unknown argument `" + key + "`");
  }
  return arguments;
}

void PrintTimes(const char* name, std::vector<double> ms, size_t num_frames) {
  if (ms.empty()) return;
  std::sort(ms.begin(), ms.end());
  const size_t last = ms.size() - 1;
  std::printf("%-10s steps %zu median %.1f ms p95 %.1f ms max %.1f ms; %.2f ms a frame\n", name, ms.size(),
              ms[last / 2], ms[last * 95 / 100], ms[last],
              std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(num_frames));
}

void WriteFiles(const FeatureSequence& sequence, const OfflineRun& run, const std::filesystem::path& out_dir) {
  std::filesystem::create_directories(out_dir);
  std::ofstream live_file(out_dir / "trajectory_live.txt"), file(out_dir / "trajectory.txt");
  std::ofstream truth_file(out_dir / "ground_truth.txt");
  const std::map<FrameId, Rigid3> live = run.Live(), optimized = run.Optimized();
  for (const FeatureFrame& frame : sequence.frames) {
    if (const auto pose = live.find(frame.frame); pose != live.end()) {
      live_file << TumRow(frame.utime_us, pose->second);
    }
    if (const auto pose = optimized.find(frame.frame); pose != optimized.end()) {
      file << TumRow(frame.utime_us, pose->second);
    }
  }
  std::ofstream frames_file(out_dir / "frames.csv");
  frames_file << "frame,features,matches,inliers,is_keyframe\n";
  for (const PoseEstimate& pose : run.poses) {
    frames_file << pose.frame.value << ',' << pose.num_features << ',' << pose.num_matches << ',' << pose.num_inliers
                << ',' << pose.is_keyframe << '\n';
  }
  for (const GroundTruthPose& pose : sequence.ground_truth) {
    truth_file << TumRow(pose.utime_us, pose.world_from_camera);
  }
}

// What tells how hard a sequence is, one row under its names.
void WriteFigures(const FeatureSequence& sequence, const OfflineRun& run, const std::filesystem::path& out_dir) {
  const auto mean = [](const auto& values, auto number_of) {
    double sum = 0.0;
    for (const auto& value : values) sum += static_cast<double>(number_of(value));
    return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
  };
  const Map& map = run.mapper.map();
  double num_observations = 0.0, length_m = 0.0;
  map.landmarks().ForEach(
      [&](LandmarkId id, const Landmark&) { num_observations += static_cast<double>(map.ObservationsOf(id).size()); });
  for (size_t i = 1; i < sequence.ground_truth.size(); ++i) {
    if (sequence.ground_truth[i].frame > sequence.frames.back().frame) break;
    length_m += (sequence.ground_truth[i].world_from_camera.translation -
                 sequence.ground_truth[i - 1].world_from_camera.translation)
                    .norm();
  }
  const bool is_mono = sequence.calibration.sensor == SensorType::kMono;
  const double rms_m = RmsError(run.Optimized(), sequence.ground_truth, is_mono).value_or(-1.0);
  std::ofstream file(out_dir / "figures.csv");
  file << "frames,lost,corners_per_image,matches_per_frame,observations_per_landmark,loops,length_m,rms_m\n"
       << run.poses.size() << ',' << run.num_lost << ',' << mean(sequence.num_corners, [](int64_t n) { return n; })
       << ',' << mean(run.poses, [](const PoseEstimate& pose) { return pose.num_inliers; }) << ','
       << num_observations / std::max(1.0, static_cast<double>(map.landmarks().size())) << ','
       << map.closed_loops().size() << ',' << length_m << ',' << rms_m << '\n';
}

// Stretches of which the run says that the scale may have changed (MAX_SCALE_SIGMA of procman).
void ReportDoubtfulScale(const std::vector<PoseEstimate>& poses) {
  constexpr double kMaxSigma = 0.25;
  constexpr int64_t kMaxGap_frames = 10;
  struct Stretch {
    int64_t first, last;
    double sigma;
  };
  std::vector<Stretch> stretches;
  for (const PoseEstimate& pose : poses) {
    if (pose.state != TrackingState::kTracked || pose.scale_sigma <= kMaxSigma) continue;
    const int64_t frame = pose.frame.value;
    if (stretches.empty() || frame > stretches.back().last + kMaxGap_frames) stretches.push_back({frame, frame, 0.0});
    stretches.back().last = frame;
    stretches.back().sigma = std::max(stretches.back().sigma, pose.scale_sigma);
  }
  std::printf("scale told to be in doubt in frames:");
  for (const Stretch& stretch : stretches) {
    std::printf(" %ld to %ld (%.2f)", static_cast<long>(stretch.first), static_cast<long>(stretch.last), stretch.sigma);
  }
  std::printf("%s\n", stretches.empty() ? " none" : "");
}

void Report(const FeatureSequence& sequence, const OfflineRun& run) {
  const bool is_mono = sequence.calibration.sensor == SensorType::kMono;
  const std::map<FrameId, Rigid3> optimized = run.Optimized();
  const Map& map = run.mapper.map();
  std::printf("frames %zu, tracked %zu from frame %ld, lost %d, failures %d, relocalized %d\n", run.poses.size(),
              optimized.size(), optimized.empty() ? -1L : static_cast<long>(optimized.begin()->first.value),
              run.num_lost, run.num_failures, run.num_relocalized);
  std::printf("keyframes made %zu, kept %ld, landmarks %ld, map %s\n", run.map_ms.size(),
              static_cast<long>(map.keyframes().size()), static_cast<long>(map.landmarks().size()),
              map.Sha256Hex().c_str());
  std::printf("RMS error %.4f m, live %.4f m\n", RmsError(optimized, sequence.ground_truth, is_mono).value_or(-1.0),
              RmsError(run.Live(), sequence.ground_truth, is_mono).value_or(-1.0));
  std::printf("readout %.1f ms down, %.1f ms across, depths %.1f ms later, right images %.1f ms later\n",
              1e3 * run.readout.down_s, 1e3 * run.readout.across_s, 1e3 * run.depth_delay_s, 1e3 * run.right_delay_s);
  std::printf("lens found: fx %.2f px (0: as calibrated), radial %+.4f, right %+.3f %+.3f %+.3f %+.3f\n",
              map.lens().fx_px, map.lens().radial, map.lens().right_shift.center_px, map.lens().right_shift.across_px,
              map.lens().right_shift.down_px, map.lens().right_shift.bend_px);
  if (is_mono) ReportDoubtfulScale(run.poses);
  if (const auto scale = is_mono ? MeasureScale(optimized, sequence.ground_truth) : std::nullopt) {
    std::printf("scale: greatest change within 10 s %.3f, until %.1f s; typical change over 5 s %.3f\n",
                scale->greatest, scale->greatest_s, scale->typical);
  }
  if (const auto consistency = MeasureConsistency(run, sequence.ground_truth, is_mono)) {
    const double dof = is_mono ? 5.0 : 6.0;
    std::printf("NEES / %.0f %.2f (95 %% band 1 +- %.2f), %.0f %% within 95 %%; velocity error %.3f m/s RMS\n", dof,
                consistency->nees_per_dof, 1.96 * std::sqrt(2.0 / (dof * consistency->num_poses)),
                100.0 * consistency->share_within, consistency->velocity_rms);
  }
  PrintTimes("extraction", sequence.extract_ms, sequence.frames.size());
  PrintTimes("tracker", run.track_ms, sequence.frames.size());
  PrintTimes("mapper", run.map_ms, sequence.frames.size());
  PrintTimes("loops", run.loop_ms, sequence.frames.size());
  PrintTimes("adjuster", run.adjust_ms, sequence.frames.size());
  int num_candidates = 0, num_consistent = 0, num_matched = 0, num_aligned = 0, num_confirmed = 0, num_contradicted = 0;
  for (const LoopResult& loop : run.loops) {
    num_candidates += loop.num_candidates;
    num_consistent += loop.num_consistent;
    num_matched += loop.num_matched;
    num_aligned += loop.num_aligned;
    num_contradicted += loop.num_contradicted;
    num_confirmed += loop.matched.valid() ? 1 : 0;
  }
  std::printf(
      "loop candidates %d, consistent %d, matched %d, aligned %d, contradicted %d, confirmed %d, void %ld, closed "
      "%zu\n",
      num_candidates, num_consistent, num_matched, num_aligned, num_contradicted, num_confirmed,
      static_cast<long>(run.mapper.num_void_loops()), map.closed_loops().size());
}

void Run(const Arguments& arguments, const FeatureSequence& sequence, int64_t map_delay_frames,
         const std::filesystem::path& out_dir) {
  OfflineRun run(MapperOptions{});
  if (!arguments.vocabulary.empty()) {
    run.loop_closer = std::make_unique<LoopCloser>(Vocabulary::Load(arguments.vocabulary), LoopCloserOptions{});
  }
  Play(sequence.frames, MapTrackerOptions{}, map_delay_frames, run);
  Report(sequence, run);
  WriteFiles(sequence, run, out_dir);
  WriteFigures(sequence, run, out_dir);
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr
        << "usage: offline_slam SOURCE SENSOR OUT_DIR [first=0] [last=-1] [delay=3[,4...]] [features=2000] [mirror=0] "
           "[turn=0] [reverse=0] [step=1] [focal_percent=0] [repeat=0] [jitter_ms=0] [dim=1] [dirt=0] [gaps=0] "
           "[min_focal=0] [vocabulary=FILE]\n";
    return 2;
  }
  try {
    const tessera::Arguments arguments = tessera::ParseArguments(argc, argv);
    const tessera::FeatureSequence sequence =
        tessera::ExtractSequence(arguments.source, arguments.features, arguments.variation);
    const std::filesystem::path out_dir = argv[3];
    for (const int64_t delay : arguments.map_delays) {
      const bool is_single = arguments.map_delays.size() == 1;
      if (!is_single) std::printf("delay %ld\n", static_cast<long>(delay));
      tessera::Run(arguments, sequence, delay, is_single ? out_dir : out_dir / ("delay_" + std::to_string(delay)));
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return 0;
}
