#include "support/example_values.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "features/tile_packing.h"

namespace tessera {
namespace {

int Draw(std::mt19937& generator, int lowest, int highest) {
  return std::uniform_int_distribution<int>(lowest, highest)(generator);
}

double DrawReal(std::mt19937& generator, double lowest, double highest) {
  return std::uniform_real_distribution<double>(lowest, highest)(generator);
}

template <class Pixel>
Image<Pixel> DrawImage(std::mt19937& generator, int width, int height) {
  Image<Pixel> image(width, height);
  for (Pixel& pixel : image.pixels) pixel = static_cast<Pixel>(generator());
  return image;
}

// Another one for each time, either way.
int64_t DepthDelayOf(int64_t utime_us) { return utime_us % 40'001 - 20'000; }

Rigid3 DrawPose(std::mt19937& generator) {
  Eigen::Quaterniond rotation(DrawReal(generator, -1, 1), DrawReal(generator, -1, 1), DrawReal(generator, -1, 1),
                              DrawReal(generator, 0.1, 1));
  return {rotation.normalized(),
          {DrawReal(generator, -99, 99), DrawReal(generator, -99, 99), DrawReal(generator, -99, 99)}};
}

CameraCalibration DrawCalibration(std::mt19937& generator, int width, int height) {
  CameraCalibration calibration{.sensor = static_cast<SensorType>(Draw(generator, 0, 2)),
                                .width_px = width,
                                .height_px = height,
                                .fx_px = DrawReal(generator, 100, 900),
                                .fy_px = DrawReal(generator, 100, 900),
                                .cx_px = DrawReal(generator, 1, 900),
                                .cy_px = DrawReal(generator, 1, 900)};
  if (calibration.sensor == SensorType::kStereo) calibration.baseline_m = 0.5;
  if (calibration.sensor == SensorType::kRgbd) calibration.depth_unit_m = 0.0002;
  return calibration;
}

Descriptor DrawDescriptor(std::mt19937& generator) {
  Descriptor descriptor;
  for (uint64_t& word : descriptor) word = (static_cast<uint64_t>(generator()) << 32) | generator();
  return descriptor;
}

bool AreSamePose(const Rigid3& a, const Rigid3& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

}  // namespace

template <>
CameraFrame DrawValue<CameraFrame>(std::mt19937& generator, int size) {
  const int width = size == 0 ? 1 : Draw(generator, 300, 1300);
  const int height = size == 0 ? 1 : Draw(generator, 50, 130);
  CameraFrame frame{.id = {Draw(generator, 0, 9999)}, .utime_us = Draw(generator, 0, 1 << 30)};
  frame.sensor = static_cast<SensorType>(Draw(generator, 0, 2));
  frame.depth_delay_us = DepthDelayOf(frame.utime_us);
  frame.left = DrawImage<uint8_t>(generator, width, height);
  if (frame.sensor == SensorType::kStereo) frame.right = DrawImage<uint8_t>(generator, width, height);
  if (frame.sensor == SensorType::kRgbd) frame.depth = DrawImage<uint16_t>(generator, width, height);
  return frame;
}
template <>
bool AreSame(const CameraFrame& a, const CameraFrame& b) {
  return a == b;
}

template <>
ColorFrame DrawValue<ColorFrame>(std::mt19937& generator, int size) {
  ColorFrame frame{.id = {Draw(generator, 0, 9999)}, .utime_us = Draw(generator, 0, 1 << 30)};
  if (size == 0) return frame;
  frame.image = ColorImage(Draw(generator, 300, 700), Draw(generator, 50, 130));
  for (Rgb& pixel : frame.image.pixels) {
    const auto channel = [&] { return static_cast<uint8_t>(generator() % 256); };
    pixel = {.red = channel(), .green = channel(), .blue = channel()};
  }
  return frame;
}
template <>
bool AreSame(const ColorFrame& a, const ColorFrame& b) {
  return a == b;
}

template <>
CameraCalibration DrawValue<CameraCalibration>(std::mt19937& generator, int) {
  return DrawCalibration(generator, Draw(generator, 1, 2000), Draw(generator, 1, 2000));
}
template <>
bool AreSame(const CameraCalibration& a, const CameraCalibration& b) {
  return a == b;
}

template <>
GroundTruthPose DrawValue<GroundTruthPose>(std::mt19937& generator, int) {
  return {.frame = {Draw(generator, 0, 9999)},
          .utime_us = Draw(generator, 0, 1 << 30),
          .world_from_camera = DrawPose(generator)};
}
template <>
bool AreSame(const GroundTruthPose& a, const GroundTruthPose& b) {
  return a.frame == b.frame && a.utime_us == b.utime_us && AreSamePose(a.world_from_camera, b.world_from_camera);
}

template <>
EndOfStream DrawValue<EndOfStream>(std::mt19937& generator, int) {
  return {.stage = StageKind::kCamera,
          .num_frames = Draw(generator, 10, 999),
          .num_dropped = Draw(generator, 0, 10),
          .num_values = Draw(generator, 0, 999)};
}
template <>
bool AreSame(const EndOfStream& a, const EndOfStream& b) {
  return a.stage == b.stage && a.num_frames == b.num_frames && a.num_dropped == b.num_dropped &&
         a.num_values == b.num_values;
}

template <>
TileJob DrawValue<TileJob>(std::mt19937& generator, int size) {
  const int width = size == 0 ? 8 : Draw(generator, 300, 900);
  const int height = size == 0 ? 8 : Draw(generator, 60, 200);
  TileJob job;
  job.run = 1'700'000'000'000'000 + Draw(generator, 0, 999);
  job.frame = {Draw(generator, 1, 9999)};
  job.previous_frame = {job.frame.value - 1};
  job.utime_us = Draw(generator, 0, 1 << 30);
  job.captured_us = Draw(generator, 0, 1 << 30);
  job.depth_delay_us = DepthDelayOf(job.utime_us);
  job.num_tiles = Draw(generator, 1, 17);
  job.tile = job.num_tiles - 1;
  job.calibration = DrawCalibration(generator, width, height);
  if (Draw(generator, 0, 1) == 1) job.min_priority = {5, 0, 1 << 28, 7, 0, 0, 9, 1};
  job.first_level = 1;
  job.last_level = 4;
  job.left_rect = {2, 3, width - 4, height - 5};
  job.core = {3, 4, width - 6, height - 7};
  job.left = DrawImage<uint8_t>(generator, job.left_rect.width, job.left_rect.height);
  if (job.calibration.sensor == SensorType::kStereo) {
    job.right_rect = {0, 3, width - 1, height - 5};
    job.right = DrawImage<uint8_t>(generator, job.right_rect.width, job.right_rect.height);
  }
  if (job.calibration.sensor == SensorType::kRgbd) {
    job.depth_rect = job.core;
    job.depth = DrawImage<uint16_t>(generator, job.depth_rect.width, job.depth_rect.height);
  }
  return Draw(generator, 0, 1) == 1 ? PackTile(job) : job;
}
template <>
bool AreSame(const TileJob& a, const TileJob& b) {
  return a == b;
}

template <>
TileFeatures DrawValue<TileFeatures>(std::mt19937& generator, int size) {
  TileFeatures features;
  features.run = 1'700'000'000'000'000 + Draw(generator, 0, 999);
  features.frame = {Draw(generator, 1, 9999)};
  features.previous_frame = {Draw(generator, -1, 0)};
  features.utime_us = Draw(generator, 0, 1 << 30);
  features.captured_us = Draw(generator, 0, 1 << 30);
  features.depth_delay_us = DepthDelayOf(features.utime_us);
  features.num_tiles = 3;
  features.tile = Draw(generator, 0, 2);
  features.calibration = DrawCalibration(generator, 640, 480);
  if (Draw(generator, 0, 1) == 1) {
    for (int level = 0; level < 8; ++level) features.cuts.push_back({Draw(generator, 0, 99), Draw(generator, 0, 999)});
  }
  const int num_candidates = size == 0 ? 0 : Draw(generator, 100, 3000);
  for (int i = 0; i < num_candidates; ++i) {
    features.candidates.push_back({.x = static_cast<int16_t>(Draw(generator, 0, 639)),
                                   .y = static_cast<int16_t>(Draw(generator, 0, 479)),
                                   .offset_x = static_cast<int8_t>(Draw(generator, -32, 32)),
                                   .offset_y = static_cast<int8_t>(Draw(generator, -32, 32)),
                                   .level = static_cast<uint8_t>(Draw(generator, 0, 7)),
                                   .angle = static_cast<uint8_t>(generator()),
                                   .score = static_cast<uint16_t>(generator()),
                                   .right_x_px = static_cast<float>(DrawReal(generator, -1, 640)),
                                   .depth_m = static_cast<float>(DrawReal(generator, 0, 9))});
    features.descriptors.push_back(DrawDescriptor(generator));
  }
  return features;
}
template <>
bool AreSame(const TileFeatures& a, const TileFeatures& b) {
  return a == b;
}

template <>
TileAck DrawValue<TileAck>(std::mt19937& generator, int size) {
  TileAck ack{
      .frame = {Draw(generator, 0, 999)}, .tiles = {}, .wants_all = Draw(generator, 0, 1) == 1, .lowest_priority = {}};
  for (int level = 0; level < 4 * size; ++level) ack.lowest_priority.push_back(Draw(generator, 0, 1 << 28));
  for (int i = 0; i < 8 * size; ++i) ack.tiles.push_back(Draw(generator, 0, 99));
  return ack;
}
template <>
bool AreSame(const TileAck& a, const TileAck& b) {
  return a.frame == b.frame && a.tiles == b.tiles && a.wants_all == b.wants_all &&
         a.lowest_priority == b.lowest_priority;
}

template <>
ExtractorReady DrawValue<ExtractorReady>(std::mt19937& generator, int) {
  return {.extractor = Draw(generator, 0, 99),
          .epoch_us = 1'700'000'000'000'000,
          .num_jobs_done = Draw(generator, 0, 99),
          .num_robots = Draw(generator, 1, 9)};
}
template <>
bool AreSame(const ExtractorReady& a, const ExtractorReady& b) {
  return a.extractor == b.extractor && a.epoch_us == b.epoch_us && a.num_jobs_done == b.num_jobs_done &&
         a.num_robots == b.num_robots;
}

template <>
FeatureFrame DrawValue<FeatureFrame>(std::mt19937& generator, int size) {
  FeatureFrame frame;
  frame.frame = {Draw(generator, 0, 9999)};
  frame.utime_us = Draw(generator, 0, 1 << 30);
  frame.captured_us = Draw(generator, 0, 1 << 30);
  frame.depth_delay_us = DepthDelayOf(frame.utime_us);
  frame.calibration = DrawCalibration(generator, 1241, 376);
  const int num_keypoints = size == 0 ? 0 : Draw(generator, 100, 3000);
  for (int i = 0; i < num_keypoints; ++i) {
    frame.keypoints.push_back({.x_px = static_cast<float>(DrawReal(generator, 0, 1240)),
                               .y_px = static_cast<float>(DrawReal(generator, 0, 375)),
                               .right_x_px = static_cast<float>(DrawReal(generator, -1, 1240)),
                               .depth_m = static_cast<float>(DrawReal(generator, 0, 9)),
                               .score = static_cast<uint16_t>(generator()),
                               .level = static_cast<uint8_t>(Draw(generator, 0, 7)),
                               .angle = static_cast<uint8_t>(generator())});
    frame.descriptors.push_back(DrawDescriptor(generator));
  }
  return frame;
}
template <>
bool AreSame(const FeatureFrame& a, const FeatureFrame& b) {
  return a.frame == b.frame && a.utime_us == b.utime_us && a.captured_us == b.captured_us &&
         a.depth_delay_us == b.depth_delay_us && a.calibration == b.calibration && a.keypoints == b.keypoints &&
         a.descriptors == b.descriptors;
}

namespace {

// Of a keyframe, whose depths are those of the image.
FeatureFrame DrawKeyframeFeatures(std::mt19937& generator, int size) {
  FeatureFrame features = DrawValue<FeatureFrame>(generator, size);
  features.depth_delay_us = 0;
  return features;
}

MotionPrior DrawMotionPrior(std::mt19937& generator) {
  MotionPrior prior{.position_in_reference = DrawPose(generator).translation};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column <= row; ++column) {
      prior.information(row, column) = prior.information(column, row) = DrawReal(generator, 0, 9);
    }
  }
  return prior;
}

}  // namespace

template <>
KeyframeObservation DrawValue<KeyframeObservation>(std::mt19937& generator, int size) {
  const int id = Draw(generator, 10, 99);
  KeyframeObservation keyframe{.id = {id},
                               .features = DrawKeyframeFeatures(generator, size),
                               .world_from_camera = DrawPose(generator),
                               .landmarks = {},
                               .reference = {Draw(generator, -1, id - 1)},
                               .reference_from_camera = DrawPose(generator),
                               .expected = DrawMotionPrior(generator),
                               .shared = {},
                               .num_deltas = Draw(generator, 0, 99)};
  for (size_t i = 0; i < keyframe.features.keypoints.size(); ++i) {
    keyframe.landmarks.push_back({Draw(generator, -1, 9999)});
    if (generator() % 3 == 0) continue;
    keyframe.shared.push_back({static_cast<int32_t>(i),
                               {Draw(generator, 0, id - 1)},
                               Draw(generator, 0, 999),
                               DrawPose(generator).translation});
    keyframe.mendings = {{{id - 7}, 0.5}, {{id - 2}, -0.7}};
  }
  keyframe.not_scene = {{3}, {17}};
  return keyframe;
}
template <>
bool AreSame(const KeyframeObservation& a, const KeyframeObservation& b) {
  const auto is_same = [](const SharedKeypoint& x, const SharedKeypoint& y) {
    return x.keypoint == y.keypoint && x.other == y.other && x.other_keypoint == y.other_keypoint &&
           x.position_in_other == y.position_in_other;
  };
  return a.id == b.id && AreSame(a.features, b.features) && AreSamePose(a.world_from_camera, b.world_from_camera) &&
         a.landmarks == b.landmarks && a.reference == b.reference &&
         AreSamePose(a.reference_from_camera, b.reference_from_camera) && a.num_deltas == b.num_deltas &&
         a.expected.position_in_reference == b.expected.position_in_reference &&
         a.expected.information == b.expected.information &&
         std::equal(a.shared.begin(), a.shared.end(), b.shared.begin(), b.shared.end(), is_same) &&
         a.mendings == b.mendings && a.not_scene == b.not_scene;
}

namespace {

Landmark DrawLandmark(std::mt19937& generator) {
  return {.position_in_world = DrawPose(generator).translation,
          .normal = DrawPose(generator).translation.normalized(),
          .depth_sigma = DrawReal(generator, 0, 9),
          .min_distance = DrawReal(generator, 0, 9),
          .max_distance = DrawReal(generator, 9, 99),
          .descriptor = DrawDescriptor(generator)};
}

// Keyframes, landmarks, observations and loops: what a snapshot is made of.
MapDelta DrawContent(std::mt19937& generator, int size) {
  MapDelta delta{.number = Draw(generator, 0, 99), .answers = {Draw(generator, -1, 99)}, .hash = generator()};
  if (size > 0) {
    delta.lens = {DrawReal(generator, 1, 999), DrawReal(generator, 1, 999), -0.0123, {0.5, -0.25, 7.0, -2.0}};
  }
  for (int i = 0; i < 3 * size; ++i) {
    auto features = std::make_shared<FeatureFrame>(DrawKeyframeFeatures(generator, i % 2));
    delta.new_keyframes.push_back(
        {{i}, {Draw(generator, -1, 9)}, DrawPose(generator), std::move(features), DrawReal(generator, 0.1, 9)});
  }
  const int num_landmarks = size * Draw(generator, 1, 2000);
  for (int i = 0; i < num_landmarks; ++i) {
    delta.changed_landmarks.push_back({{Draw(generator, 0, 9999)}, DrawLandmark(generator)});
    delta.new_observations.push_back({{Draw(generator, 0, 99)}, {{Draw(generator, 0, 99)}, Draw(generator, 0, 99)}});
  }
  for (int i = 0; i < 20 * size; ++i) {
    delta.closed_loops.push_back({{Draw(generator, 0, 99)}, {Draw(generator, 0, 99)}, DrawReal(generator, 0.1, 9), 7});
  }
  return delta;
}

bool AreSameKeyframe(const MapDelta::NewKeyframe& a, const MapDelta::NewKeyframe& b) {
  return a.id == b.id && a.parent == b.parent && AreSamePose(a.world_from_camera, b.world_from_camera) &&
         a.scale == b.scale && AreSame(*a.features, *b.features);
}

template <class Item, class IsSame>
bool AreSameLists(const std::vector<Item>& a, const std::vector<Item>& b, IsSame is_same) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), is_same);
}

}  // namespace

template <>
MapDelta DrawValue<MapDelta>(std::mt19937& generator, int size) {
  MapDelta delta = DrawContent(generator, size);
  for (int i = 0; i < 20 * size; ++i) {
    delta.moved_keyframes.push_back({{Draw(generator, 0, 99)}, DrawPose(generator), DrawReal(generator, 0.1, 9)});
    delta.changed_parents.push_back({{Draw(generator, 0, 99)}, {Draw(generator, -1, 99)}});
    delta.removed_keyframes.push_back({Draw(generator, 0, 99)});
  }
  delta.asks_adjustment = generator() % 2 == 0;
  for (int i = 0; i < 500 * size; ++i) {
    delta.removed_observations.push_back(
        {{Draw(generator, 0, 99)}, {{Draw(generator, 0, 99)}, Draw(generator, 0, 99)}});
    delta.removed_landmarks.push_back({Draw(generator, 0, 99)});
  }
  return delta;
}
template <>
bool AreSame(const MapDelta& a, const MapDelta& b) {
  return a.number == b.number && a.answers == b.answers && a.is_snapshot == b.is_snapshot && a.hash == b.hash &&
         a.asks_adjustment == b.asks_adjustment && a.lens == b.lens && a.closed_loops == b.closed_loops &&
         AreSameLists(a.new_keyframes, b.new_keyframes, AreSameKeyframe) &&
         AreSameLists(a.moved_keyframes, b.moved_keyframes,
                      [](const auto& x, const auto& y) {
                        return x.id == y.id && x.scale == y.scale &&
                               AreSamePose(x.world_from_camera, y.world_from_camera);
                      }) &&
         AreSameLists(a.changed_landmarks, b.changed_landmarks,
                      [](const auto& x, const auto& y) { return x.id == y.id && x.landmark == y.landmark; }) &&
         a.removed_observations == b.removed_observations && a.new_observations == b.new_observations &&
         AreSameLists(a.changed_parents, b.changed_parents,
                      [](const auto& x, const auto& y) { return x.id == y.id && x.parent == y.parent; }) &&
         a.removed_landmarks == b.removed_landmarks && a.removed_keyframes == b.removed_keyframes;
}

template <>
MapSnapshotPage DrawValue<MapSnapshotPage>(std::mt19937& generator, int size) {
  MapSnapshotPage page{.page = Draw(generator, 0, 9), .num_pages = 10, .part = DrawContent(generator, size)};
  page.part.is_snapshot = true;
  return page;
}
template <>
bool AreSame(const MapSnapshotPage& a, const MapSnapshotPage& b) {
  return a.page == b.page && a.num_pages == b.num_pages && AreSame(a.part, b.part);
}

template <>
MapRequest DrawValue<MapRequest>(std::mt19937& generator, int) {
  return {.next_delta = Draw(generator, -1, 99), .snapshot = Draw(generator, -1, 99), .page = Draw(generator, 0, 99)};
}
template <>
bool AreSame(const MapRequest& a, const MapRequest& b) {
  return a == b;
}

template <>
MapFileHeader DrawValue<MapFileHeader>(std::mt19937& generator, int) {
  return {.version = Draw(generator, 0, 9),
          .num_pages = Draw(generator, 1, 999),
          .num_keyframes = Draw(generator, 0, 999),
          .num_landmarks = Draw(generator, 0, 9999),
          .camera = DrawCalibration(generator, 1241, 376)};
}
template <>
bool AreSame(const MapFileHeader& a, const MapFileHeader& b) {
  return a.version == b.version && a.num_pages == b.num_pages && a.num_keyframes == b.num_keyframes &&
         a.num_landmarks == b.num_landmarks && a.camera == b.camera;
}

namespace {

std::vector<SeenLandmark> DrawSeen(std::mt19937& generator, int num) {
  std::vector<SeenLandmark> seen;
  for (int i = 0; i < num; ++i) seen.push_back({Draw(generator, 0, 1999), {Draw(generator, 0, 99999)}});
  return seen;
}

Sim3 DrawSimilarity(std::mt19937& generator) {
  const Rigid3 pose = DrawPose(generator);
  return Sim3::From(pose, DrawReal(generator, 0.1, 9));
}

bool AreSameSimilarity(const Sim3& a, const Sim3& b) { return a.scale == b.scale && AreSamePose(a.Pose(), b.Pose()); }

}  // namespace

template <>
RemovedInDelta DrawValue<RemovedInDelta>(std::mt19937& generator, int size) {
  RemovedInDelta removed{.delta = Draw(generator, 0, 999), .links = {}};
  const int num_links = size == 0 ? 0 : 2000;
  for (int i = 0; i < num_links; ++i)
    removed.links.push_back({{i}, {Draw(generator, 0, 99)}, DrawSimilarity(generator)});
  return removed;
}
template <>
bool AreSame(const RemovedInDelta& a, const RemovedInDelta& b) {
  return a.delta == b.delta && AreSameLists(a.links, b.links, [](const auto& x, const auto& y) {
           return x.keyframe == y.keyframe && x.parent == y.parent &&
                  AreSameSimilarity(x.parent_from_keyframe, y.parent_from_keyframe);
         });
}

template <>
MapperStep DrawValue<MapperStep>(std::mt19937& generator, int size) {
  return {.is_repeatable = size > 0,
          .delta = DrawValue<MapDelta>(generator, size),
          .removed = DrawValue<RemovedInDelta>(generator, size).links,
          .first_recent = {Draw(generator, 0, 999)},
          .end_landmark = {Draw(generator, 1000, 2000)}};
}
template <>
bool AreSame(const MapperStep& a, const MapperStep& b) {
  return a.is_repeatable == b.is_repeatable && AreSame(a.delta, b.delta) &&
         AreSame(RemovedInDelta{0, a.removed}, RemovedInDelta{0, b.removed}) && a.first_recent == b.first_recent &&
         a.end_landmark == b.end_landmark;
}

template <>
OccupancyUpdate DrawValue<OccupancyUpdate>(std::mt19937& generator, int size) {
  OccupancyUpdate update{.number = Draw(generator, 0, 999),
                         .resolution = DrawReal(generator, 0.01, 1.0),
                         .is_whole = Draw(generator, 0, 1) == 1,
                         .num_keyframes = Draw(generator, 0, 99),
                         .blocks = {},
                         .colors = {}};
  const int num_blocks = size == 0 ? 0 : 150;
  for (int i = 0; i < num_blocks; ++i) {
    OccupancyBlock block{.x = Draw(generator, -2048, 2047), .y = Draw(generator, -9, 9), .z = i};
    for (size_t voxel = 0; voxel < OccupancyBlock::kNumVoxels; ++voxel) {
      block.Set(voxel, static_cast<VoxelState>(Draw(generator, 0, 2)));
    }
    update.blocks.push_back(block);
    const size_t num_colors = update.is_whole ? block.NumOccupied() : 0;
    for (size_t voxel = 0; voxel < num_colors; ++voxel) {
      const auto draw = [&] { return static_cast<uint8_t>(Draw(generator, 0, 255)); };
      update.colors.push_back({.red = draw(), .green = draw(), .blue = draw()});
    }
  }
  return update;
}
template <>
bool AreSame(const OccupancyUpdate& a, const OccupancyUpdate& b) {
  return a == b;
}

template <>
OccupancyRequest DrawValue<OccupancyRequest>(std::mt19937& generator, int) {
  return {.num_asked = Draw(generator, 0, 99)};
}
template <>
bool AreSame(const OccupancyRequest& a, const OccupancyRequest& b) {
  return a == b;
}

template <>
LoopResult DrawValue<LoopResult>(std::mt19937& generator, int size) {
  LoopResult result;
  result.answers = {Draw(generator, 10, 999)};
  result.num_candidates = Draw(generator, 0, 9);
  result.num_consistent = Draw(generator, 0, 9);
  result.num_matched = Draw(generator, 0, 9);
  result.num_aligned = Draw(generator, 0, 9);
  result.num_contradicted = Draw(generator, 0, 9);
  if (size == 0) return result;
  result.matched = {Draw(generator, 0, 9)};
  result.matched_from_current = DrawSimilarity(generator);
  result.joins_parts = Draw(generator, 0, 1) == 1;
  const int num_corrections = Draw(generator, 1, 300);
  for (int i = 0; i < num_corrections; ++i) result.corrections.push_back({{i}, DrawSimilarity(generator)});
  result.seen = DrawSeen(generator, Draw(generator, 1, 900));
  return result;
}
template <>
bool AreSame(const LoopResult& a, const LoopResult& b) {
  return a.answers == b.answers && a.matched == b.matched &&
         AreSameSimilarity(a.matched_from_current, b.matched_from_current) && a.joins_parts == b.joins_parts &&
         a.seen == b.seen && a.num_candidates == b.num_candidates && a.num_consistent == b.num_consistent &&
         a.num_matched == b.num_matched && a.num_aligned == b.num_aligned && a.num_contradicted == b.num_contradicted &&
         AreSameLists(a.corrections, b.corrections, [](const auto& x, const auto& y) {
           return x.id == y.id && AreSameSimilarity(x.new_world_from_old, y.new_world_from_old);
         });
}

template <>
GlobalAdjustment DrawValue<GlobalAdjustment>(std::mt19937& generator, int size) {
  GlobalAdjustment adjustment;
  adjustment.answers = {Draw(generator, 0, 999)};
  adjustment.delta = Draw(generator, 0, 999);
  adjustment.is_usable = size > 0;
  const int num_poses = size * Draw(generator, 1, 300), num_points = size * Draw(generator, 1, 3000);
  for (int i = 0; i < num_poses; ++i) adjustment.poses.push_back({{i}, DrawPose(generator)});
  for (int i = 0; i < num_points; ++i) adjustment.points.push_back({{i}, DrawPose(generator).translation});
  return adjustment;
}
template <>
bool AreSame(const GlobalAdjustment& a, const GlobalAdjustment& b) {
  return a.answers == b.answers && a.delta == b.delta && a.is_usable == b.is_usable &&
         AreSameLists(a.poses, b.poses,
                      [](const auto& x, const auto& y) {
                        return x.id == y.id && AreSamePose(x.world_from_camera, y.world_from_camera);
                      }) &&
         AreSameLists(a.points, b.points, [](const auto& x, const auto& y) {
           return x.id == y.id && x.position_in_world == y.position_in_world;
         });
}

template <>
RelocalizationRequest DrawValue<RelocalizationRequest>(std::mt19937& generator, int size) {
  return {.features = DrawKeyframeFeatures(generator, size), .last_keyframe = {Draw(generator, -1, 99)}};
}
template <>
bool AreSame(const RelocalizationRequest& a, const RelocalizationRequest& b) {
  return AreSame(a.features, b.features) && a.last_keyframe == b.last_keyframe;
}

template <>
RelocalizationAnswer DrawValue<RelocalizationAnswer>(std::mt19937& generator, int size) {
  return {.frame = {Draw(generator, 0, 9999)},
          .reference = {size == 0 ? -1 : Draw(generator, 0, 99)},
          .reference_from_camera = DrawPose(generator),
          .seen = DrawSeen(generator, size * Draw(generator, 1, 900)),
          .num_candidates = Draw(generator, 0, 9)};
}
template <>
bool AreSame(const RelocalizationAnswer& a, const RelocalizationAnswer& b) {
  return a.frame == b.frame && a.reference == b.reference &&
         AreSamePose(a.reference_from_camera, b.reference_from_camera) && a.seen == b.seen &&
         a.num_candidates == b.num_candidates;
}

static BodyState DrawBody(std::mt19937& generator) {
  BodyState body{.world_from_base = DrawPose(generator)};
  Matrix6d factor;
  for (int i = 0; i < factor.size(); ++i) factor(i) = Draw(generator, -9, 9);
  body.covariance = factor * factor.transpose();  // of whole numbers, so that it is symmetric to the bit
  for (int axis = 0; axis < 3; ++axis) {
    body.motion.velocity[axis] = Draw(generator, -9, 9);
    body.motion.turn_rate[axis] = Draw(generator, -9, 9);
  }
  body.has_covariance = Draw(generator, 0, 1) == 1;
  body.has_motion = Draw(generator, 0, 1) == 1;
  return body;
}
static bool AreSameBody(const BodyState& a, const BodyState& b) {
  return AreSamePose(a.world_from_base, b.world_from_base) && a.covariance == b.covariance &&
         a.motion.velocity == b.motion.velocity && a.motion.turn_rate == b.motion.turn_rate &&
         a.has_covariance == b.has_covariance && a.has_motion == b.has_motion;
}

template <>
PoseEstimate DrawValue<PoseEstimate>(std::mt19937& generator, int) {
  return {.frame = {Draw(generator, 0, 9999)},
          .utime_us = Draw(generator, 0, 1 << 30),
          .captured_us = Draw(generator, 0, 1 << 30),
          .latency_us = Draw(generator, 0, 1 << 20),
          .state = static_cast<TrackingState>(Draw(generator, 0, 2)),
          .world_from_camera = DrawPose(generator),
          .reference_keyframe = {Draw(generator, -1, 99)},
          .reference_from_camera = DrawPose(generator),
          .map_part = {Draw(generator, -1, 99)},
          .num_features = Draw(generator, 0, 2000),
          .num_matches = Draw(generator, 0, 2000),
          .num_inliers = Draw(generator, 0, 2000),
          .num_landmarks = Draw(generator, 0, 2000),
          .is_keyframe = Draw(generator, 0, 1) == 1,
          .is_relocalized = Draw(generator, 0, 1) == 1,
          .is_step_doubtful = Draw(generator, 0, 1) == 1,
          .scale_sigma = 0.01 * Draw(generator, 0, 300),
          .relocalized_by = {Draw(generator, -1, 99)},
          .num_deltas = Draw(generator, 0, 99),
          .is_live = Draw(generator, 0, 1) == 1,
          .map_wait_us = Draw(generator, 0, 9999),
          .body = DrawBody(generator),
          .coverage = 0.25 * Draw(generator, 0, 4),
          .since_tracked_us = Draw(generator, -1, 1 << 30)};
}
template <>
bool AreSame(const PoseEstimate& a, const PoseEstimate& b) {
  return a.frame == b.frame && a.utime_us == b.utime_us && a.captured_us == b.captured_us &&
         a.latency_us == b.latency_us && a.state == b.state && AreSamePose(a.world_from_camera, b.world_from_camera) &&
         a.reference_keyframe == b.reference_keyframe &&
         AreSamePose(a.reference_from_camera, b.reference_from_camera) && a.map_part == b.map_part &&
         a.num_features == b.num_features && a.num_matches == b.num_matches && a.num_inliers == b.num_inliers &&
         a.num_landmarks == b.num_landmarks && a.is_keyframe == b.is_keyframe && a.is_relocalized == b.is_relocalized &&
         a.is_step_doubtful == b.is_step_doubtful && a.scale_sigma == b.scale_sigma &&
         a.relocalized_by == b.relocalized_by && a.num_deltas == b.num_deltas && a.is_live == b.is_live &&
         a.map_wait_us == b.map_wait_us && AreSameBody(a.body, b.body) && a.coverage == b.coverage &&
         a.since_tracked_us == b.since_tracked_us;
}

template <>
StageStatus DrawValue<StageStatus>(std::mt19937& generator, int size) {
  StageStatus status{
      .name = "extractor_3", .host = "node", .version = "1.2.3", .pid = 77, .epoch_us = 1'700'000'000'000'000};
  status.state = static_cast<StageState>(Draw(generator, 0, 3));
  status.num_received = Draw(generator, 0, 999);
  status.num_published = Draw(generator, 0, 999);
  status.num_dropped = Draw(generator, 0, 999);
  status.num_repaired = Draw(generator, 0, 999);
  status.num_lost = Draw(generator, 0, 999);
  status.num_undecodable = Draw(generator, 0, 999);
  status.queue = Draw(generator, 0, 999);
  status.step = {Draw(generator, 0, 999),   DrawReal(generator, 0, 9), DrawReal(generator, 0, 9),
                 DrawReal(generator, 0, 9), DrawReal(generator, 0, 9), DrawReal(generator, 0, 9)};
  status.cpu_percent = DrawReal(generator, 0, 100);
  status.cpu_s = DrawReal(generator, 0, 100);
  status.rss_mb = DrawReal(generator, 0, 100);
  status.last_error = size == 0 ? "" : "a sentence";
  for (int i = 0; i < 5 * size; ++i)
    status.values.emplace_back("value_" + std::to_string(i), DrawReal(generator, -9, 9));
  return status;
}
template <>
bool AreSame(const StageStatus& a, const StageStatus& b) {
  const auto counts = [](const StageStatus& s) {
    return std::vector<int64_t>{s.pid,          s.epoch_us,      static_cast<int64_t>(s.state),
                                s.num_received, s.num_published, s.num_dropped,
                                s.num_repaired, s.num_lost,      s.num_undecodable,
                                s.queue,        s.step.count};
  };
  const auto figures = [](const StageStatus& s) {
    return std::vector<double>{s.step.mean_ms, s.step.median_ms, s.step.p95_ms, s.step.p99_ms,
                               s.step.max_ms,  s.cpu_percent,    s.cpu_s,       s.rss_mb};
  };
  return a.name == b.name && a.host == b.host && a.version == b.version && a.last_error == b.last_error &&
         a.values == b.values && counts(a) == counts(b) && figures(a) == figures(b);
}

template <>
Heartbeat DrawValue<Heartbeat>(std::mt19937& generator, int size) {
  Heartbeat heartbeat{.host = "node", .pid = Draw(generator, 1, 99999), .streams = {}};
  for (int i = 0; i < 16 * size; ++i) {
    const int first = Draw(generator, 0, 99);
    heartbeat.streams.push_back(
        {"TILE_" + std::to_string(i), 1'700'000'000'000'000 + i, first, first + Draw(generator, 0, 99), i % 2 == 0});
  }
  return heartbeat;
}
template <>
bool AreSame(const Heartbeat& a, const Heartbeat& b) {
  return a == b;
}

template <>
RepairRequest DrawValue<RepairRequest>(std::mt19937& generator, int size) {
  RepairRequest request{.channel = "CAMERA", .publisher = "camera", .epoch_us = 1'700'000'000'000'000, .ranges = {}};
  for (int i = 0; i < 16 * size; ++i) {
    const int first = Draw(generator, 0, 99);
    request.ranges.push_back({first, first + Draw(generator, 0, 99)});
  }
  return request;
}
template <>
bool AreSame(const RepairRequest& a, const RepairRequest& b) {
  return a == b;
}

}  // namespace tessera
