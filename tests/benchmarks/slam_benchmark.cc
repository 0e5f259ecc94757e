// Time of the tracker's step (a frame) and of the mapper's (a keyframe) in the middle of a run, on KITTI 03 mono.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <memory>
#include <vector>

#include "benchmarks/offline_run.h"

namespace tessera {
namespace {

constexpr int64_t kNumFrames = 120;
constexpr int64_t kMapDelayFrames = 3;

// What went in and out of the steps of one run.
struct Record {
  std::vector<FeatureFrame> frames;
  std::vector<std::vector<std::shared_ptr<const MapDelta>>> deltas;  // by frame: applied before it is tracked
  std::vector<KeyframeObservation> keyframes;
};

Record MakeRecord(int num_features) {
  SourceOptions source;
  source.source = std::string("kitti:") + TESSERA_DATA + "/kitti/sequences/03";
  source.last_frame = kNumFrames;
  Record record;
  record.frames = ExtractSequence(source, {.num_features = num_features}).frames;
  MapTracker tracker{MapTrackerOptions{}};
  Mapper mapper{MapperOptions{}};
  LogicalTime time(kMapDelayFrames);
  for (const FeatureFrame& frame : record.frames) {
    record.deltas.push_back(time.TakeDeltas(frame.frame));
    for (const auto& delta : record.deltas.back()) (void)tracker.ApplyDelta(*delta);
    for (const KeyframeObservation& keyframe : tracker.Track(frame).keyframes) {
      time.KeyframeSent(keyframe.id, frame.frame, 0);
      time.Receive(std::make_shared<const MapDelta>(mapper.Process(keyframe)));
      record.keyframes.push_back(keyframe);
    }
  }
  return record;
}

// Made once for each number of features; null if the data are not there.
const Record* GetRecord(benchmark::State& state) {
  static std::map<int, Record> records;
  if (!std::filesystem::exists(std::string(TESSERA_DATA) + "/kitti/sequences/03")) {
    state.SkipWithError("KITTI 03 is not there");
    return nullptr;
  }
  const int num_features = static_cast<int>(state.range(0));
  const auto found = records.find(num_features);
  return found != records.end() ? &found->second : &(records[num_features] = MakeRecord(num_features));
}

void BM_TrackerStep(benchmark::State& state) {
  const Record* record = GetRecord(state);
  for (auto _ : state) {
    if (record == nullptr) break;
    MapTracker tracker{MapTrackerOptions{}};
    for (size_t i = 0; i < record->frames.size(); ++i) {
      for (const auto& delta : record->deltas[i]) (void)tracker.ApplyDelta(*delta);
      benchmark::DoNotOptimize(tracker.Track(record->frames[i]).pose.num_inliers);
    }
  }
  state.SetItemsProcessed(state.iterations() * kNumFrames);
}
BENCHMARK(BM_TrackerStep)->ArgName("features")->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);

void BM_MapperStep(benchmark::State& state) {
  const Record* record = GetRecord(state);
  for (auto _ : state) {
    if (record == nullptr) break;
    Mapper mapper{MapperOptions{}};
    for (const KeyframeObservation& keyframe : record->keyframes) {
      benchmark::DoNotOptimize(mapper.Process(keyframe).hash);
    }
  }
  if (record != nullptr) state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(record->keyframes.size()));
}
BENCHMARK(BM_MapperStep)->ArgName("features")->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tessera
