// Every type: encode, decode, the same again; and values out of range are refused.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <typeinfo>

#include "support/example_values.h"
#include "wire/wire_type.h"

namespace tessera {
namespace {

template <class Value>
std::vector<Bytes> Encode(const Value& value, size_t max_bytes) {
  return EncodeValue(value, ExampleHeader(), max_bytes);
}

// What the decoder says of these messages: empty and *decoded if all is well.
template <class Value>
std::string Decode(const std::vector<Bytes>& messages, Value* decoded) {
  ValueJoiner<Value> joiner;
  for (const Bytes& message : messages) {
    const auto header = ReadHeader(message);
    if (!header) return "no header";
    const Result<const Value*> value = joiner.Add(message, *header);
    if (!value) return value.error().sentence;
    if (*value == nullptr) continue;
    *decoded = **value;
    return &message == &messages.back() ? "" : "complete too early";
  }
  return "incomplete";
}

struct RoundTrip {
  template <class Value>
  void operator()() const {
    SCOPED_TRACE(TypeName<Value>());
    std::mt19937 generator(1);
    for (int i = 0; i < 20; ++i) {
      const Value value = DrawValue<Value>(generator, i % 2);
      for (const size_t max_bytes : {60000U, 1380U}) {
        const std::vector<Bytes> messages = Encode(value, max_bytes);
        for (size_t k = 0; k < messages.size(); ++k) {
          EXPECT_LE(messages[k].size(), max_bytes);
          const auto header = ReadHeader(messages[k]);
          ASSERT_TRUE(header);
          EXPECT_EQ(header->publisher, "tester_7");
          EXPECT_EQ(header->epoch_us, ExampleHeader().epoch_us);
          EXPECT_EQ(header->publish_us, ExampleHeader().publish_us);
          EXPECT_EQ(header->sequence, 12 + static_cast<int64_t>(k));
          EXPECT_EQ(header->part, static_cast<int32_t>(k));
          EXPECT_EQ(header->num_parts, static_cast<int32_t>(messages.size()));
        }
        Value decoded;
        ASSERT_EQ(Decode(messages, &decoded), "");
        EXPECT_TRUE(AreSame(value, decoded));
      }
    }
  }
};

TEST(Codec, EveryTypeComesBackTheSame) { ForEachValueType(RoundTrip()); }

TEST(Codec, LargeValuesAreCut) {
  std::mt19937 generator(2);
  EXPECT_GT(Encode(DrawValue<CameraFrame>(generator, 1), 1380).size(), 10U);
  EXPECT_GT(Encode(DrawValue<FeatureFrame>(generator, 1), 1380).size(), 2U);
  EXPECT_GT(Encode(DrawValue<MapDelta>(generator, 1), 1380).size(), 10U);
  EXPECT_GT(Encode(DrawValue<LoopResult>(generator, 1), 1380).size(), 2U);
  EXPECT_GT(Encode(DrawValue<GlobalAdjustment>(generator, 1), 1380).size(), 2U);
  EXPECT_GT(Encode(DrawValue<RelocalizationRequest>(generator, 1), 1380).size(), 2U);
  EXPECT_GT(Encode(DrawValue<RelocalizationAnswer>(generator, 1), 1380).size(), 2U);
  EXPECT_EQ(Encode(DrawValue<PoseEstimate>(generator, 1), 1380).size(), 1U);
}

// A value whose parts are not all there, or of two values, never comes out.
TEST(Codec, PartsOfDifferentValuesAreNotMixed) {
  std::mt19937 generator(3);
  CameraFrame first = DrawValue<CameraFrame>(generator, 1);
  CameraFrame second = first;
  ++second.id.value;
  std::vector<Bytes> mixed = Encode(first, 10000);
  ASSERT_GE(mixed.size(), 3U);
  mixed[1] = Encode(second, 10000)[1];
  CameraFrame decoded;
  EXPECT_EQ(Decode(mixed, &decoded), "its parts do not fit together");

  std::vector<Bytes> without_one = Encode(first, 10000);
  without_one.erase(without_one.begin() + 1);
  EXPECT_EQ(Decode(without_one, &decoded), "incomplete");

  std::vector<Bytes> swapped = Encode(first, 10000);
  std::swap(swapped[1], swapped[2]);
  EXPECT_NE(Decode(swapped, &decoded), "");
}

TEST(Codec, InterruptedValueIsLostAndTheNextOneComes) {
  std::mt19937 generator(4);
  const CameraFrame frame = DrawValue<CameraFrame>(generator, 1);
  const std::vector<Bytes> messages = Encode(frame, 10000);
  ValueJoiner<CameraFrame> joiner;
  EXPECT_FALSE(joiner.Interrupt());
  (void)joiner.Add(messages[0], *ReadHeader(messages[0]));
  EXPECT_TRUE(joiner.Interrupt());
  for (size_t i = 1; i < messages.size(); ++i) {
    EXPECT_EQ(joiner.Add(messages[i], *ReadHeader(messages[i])), nullptr);
  }
  Result<const CameraFrame*> value = nullptr;
  for (const Bytes& message : messages) value = joiner.Add(message, *ReadHeader(message));
  ASSERT_TRUE(value && *value != nullptr);
  EXPECT_EQ(**value, frame);
}

// Each change makes the value invalid, and the decoder must say so.
template <class Value>
void ExpectRefused(void (*change)(Value& value)) {
  std::mt19937 generator(5);
  Value value = DrawValue<Value>(generator, 1);
  change(value);
  Value decoded;
  EXPECT_NE(Decode(Encode(value, 60000), &decoded), "") << TypeName<Value>();
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Codec, PosesOutOfRangeAreRefused) {
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.world_from_camera.translation.x() = kNan; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.world_from_camera.translation.z() = 1e30; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.world_from_camera.rotation.w() = kNan; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.reference_from_camera.rotation.coeffs() *= 1.01; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.frame.value = -1; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.state = static_cast<TrackingState>(3); });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.num_inliers = -1; });
  ExpectRefused<GroundTruthPose>([](GroundTruthPose& pose) { pose.utime_us = INT64_MAX; });
}

TEST(Codec, CamerasOutOfRangeAreRefused) {
  ExpectRefused<CameraCalibration>([](CameraCalibration& camera) { camera.fx_px = 0.0; });
  ExpectRefused<CameraCalibration>([](CameraCalibration& camera) { camera.cx_px = kNan; });
  ExpectRefused<CameraCalibration>([](CameraCalibration& camera) { camera.baseline_m = kNan; });
  ExpectRefused<CameraCalibration>([](CameraCalibration& camera) { camera.width_px = 20000; });
  ExpectRefused<CameraCalibration>([](CameraCalibration& camera) { camera.sensor = static_cast<SensorType>(7); });
  ExpectRefused<CameraFrame>([](CameraFrame& frame) { frame.sensor = static_cast<SensorType>(-1); });
  ExpectRefused<CameraFrame>([](CameraFrame& frame) {
    frame.sensor = SensorType::kStereo;
    frame.right = {};
  });
  ExpectRefused<CameraFrame>([](CameraFrame& frame) {
    frame.sensor = SensorType::kStereo;
    frame.right = GrayImage(frame.left.width + 1, frame.left.height);
  });
}

TEST(Codec, FeaturesOutOfRangeAreRefused) {
  ExpectRefused<TileJob>([](TileJob& job) { job.tile = job.num_tiles; });
  ExpectRefused<TileJob>([](TileJob& job) { job.previous_frame = job.frame; });
  ExpectRefused<TileJob>([](TileJob& job) { job.last_level = job.options.num_levels; });
  ExpectRefused<TileJob>([](TileJob& job) { job.left_rect.x = -1; });
  ExpectRefused<TileJob>([](TileJob& job) { job.left_rect.width += 100; });
  ExpectRefused<TileJob>([](TileJob& job) { job.options.num_features = 0; });
  ExpectRefused<TileFeatures>([](TileFeatures& tile) { tile.candidates[7].x = 640; });
  ExpectRefused<TileFeatures>([](TileFeatures& tile) { tile.candidates[7].level = 8; });
  ExpectRefused<TileFeatures>([](TileFeatures& tile) { tile.candidates[7].depth_m = -1.0F; });
  ExpectRefused<FeatureFrame>([](FeatureFrame& frame) { frame.keypoints[9].x_px = std::nanf(""); });
  ExpectRefused<FeatureFrame>([](FeatureFrame& frame) { frame.keypoints[9].y_px = 1e9F; });
  ExpectRefused<FeatureFrame>([](FeatureFrame& frame) { frame.keypoints[9].right_x_px = INFINITY; });
  ExpectRefused<FeatureFrame>([](FeatureFrame& frame) { frame.calibration.right_shift.down_px = 8.5; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.landmarks[0].value = -2; });
  ExpectRefused<ExtractorReady>([](ExtractorReady& ready) { ready.extractor = -1; });
  ExpectRefused<TileAck>([](TileAck& ack) { ack.tiles[0] = -1; });
  ExpectRefused<StageStatus>([](StageStatus& status) { status.rss_mb = kNan; });
  ExpectRefused<StageStatus>([](StageStatus& status) { status.num_lost = -1; });
}

TEST(Codec, ChangesOfTheMapOutOfRangeAreRefused) {
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.reference = keyframe.id; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.shared[0].other = keyframe.id; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.expected.information(0, 1) += 1.0; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.expected.information(2, 2) = -1.0; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.expected.information(1, 1) = kNan; });
  ExpectRefused<KeyframeObservation>([](KeyframeObservation& keyframe) { keyframe.shared[0].keypoint = 1 << 19; });
  ExpectRefused<KeyframeObservation>(
      [](KeyframeObservation& keyframe) { keyframe.shared[0].position_in_other.x() = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.number = -1; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.lens.right_shift.across_px = -9.0; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.lens.right_shift.bend_px = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.new_keyframes[1].id.value = -1; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.moved_keyframes[0].world_from_camera.translation.x() = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.changed_landmarks[0].landmark.normal.y() = INFINITY; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.changed_landmarks[0].landmark.max_distance = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.changed_landmarks[0].landmark.depth_sigma = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.changed_landmarks[0].landmark.depth_sigma = -1e-9; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.new_observations[0].observation.keypoint = -1; });
  ExpectRefused<MapSnapshotPage>([](MapSnapshotPage& page) { page.page = page.num_pages; });
  ExpectRefused<MapSnapshotPage>([](MapSnapshotPage& page) { page.part.removed_keyframes.push_back({1}); });
  ExpectRefused<MapRequest>([](MapRequest& request) { request.page = -1; });
  ExpectRefused<RemovedInDelta>([](RemovedInDelta& removed) { removed.links.push_back({{3}, {-1}, {}}); });
  ExpectRefused<RemovedInDelta>([](RemovedInDelta& removed) { removed.delta = -1; });
}

TEST(Codec, OccupancyOutOfRangeIsRefused) {
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.number = -1; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.resolution = 0.0; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.num_keyframes = -1; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.blocks.back().z = 2048; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.blocks[0].x = -2049; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) { update.blocks[0].states[1023] = 0x0C; });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) {
    update.colors.assign(7, Rgb());  // of more voxels
  });
  ExpectRefused<OccupancyUpdate>([](OccupancyUpdate& update) {
    update.blocks.clear();
    update.colors.assign(1, Rgb());
  });
  ExpectRefused<OccupancyRequest>([](OccupancyRequest& request) { request.num_asked = -1; });
}

TEST(Codec, LoopsAndAdjustmentsOutOfRangeAreRefused) {
  ExpectRefused<LoopResult>([](LoopResult& result) { result.answers.value = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.matched = result.answers; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.matched.value = -2; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.matched_from_current.scale = 0.0; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.matched_from_current.scale = -1.0; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.matched_from_current.rotation.coeffs() *= 1.01; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.corrections.back().id.value = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.corrections.back().new_world_from_old.scale = kNan; });
  ExpectRefused<LoopResult>(
      [](LoopResult& result) { result.corrections[0].new_world_from_old.translation.y() = kNan; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.seen.back().keypoint = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.seen.back().landmark.value = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.num_candidates = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.num_aligned = -1; });
  ExpectRefused<LoopResult>([](LoopResult& result) { result.num_contradicted = -1; });
  ExpectRefused<GlobalAdjustment>([](GlobalAdjustment& adjustment) { adjustment.answers.value = -1; });
  ExpectRefused<GlobalAdjustment>([](GlobalAdjustment& adjustment) { adjustment.delta = -1; });
  ExpectRefused<GlobalAdjustment>([](GlobalAdjustment& adjustment) { adjustment.poses.back().id.value = -1; });
  ExpectRefused<GlobalAdjustment>(
      [](GlobalAdjustment& adjustment) { adjustment.poses.back().world_from_camera.rotation.w() = kNan; });
  ExpectRefused<GlobalAdjustment>([](GlobalAdjustment& adjustment) { adjustment.points.back().id.value = -1; });
  ExpectRefused<GlobalAdjustment>(
      [](GlobalAdjustment& adjustment) { adjustment.points.back().position_in_world.z() = INFINITY; });
}

TEST(Codec, RelocalizationsAndMapFilesOutOfRangeAreRefused) {
  ExpectRefused<RelocalizationRequest>([](RelocalizationRequest& request) { request.last_keyframe.value = -2; });
  ExpectRefused<RelocalizationRequest>([](RelocalizationRequest& request) { request.features.frame.value = -1; });
  ExpectRefused<RelocalizationRequest>(
      [](RelocalizationRequest& request) { request.features.keypoints.back().x_px = std::nanf(""); });
  ExpectRefused<RelocalizationAnswer>([](RelocalizationAnswer& answer) { answer.frame.value = -1; });
  ExpectRefused<RelocalizationAnswer>([](RelocalizationAnswer& answer) { answer.reference.value = -2; });
  ExpectRefused<RelocalizationAnswer>([](RelocalizationAnswer& answer) { answer.num_candidates = -1; });
  ExpectRefused<RelocalizationAnswer>(
      [](RelocalizationAnswer& answer) { answer.reference_from_camera.translation.x() = kNan; });
  ExpectRefused<RelocalizationAnswer>([](RelocalizationAnswer& answer) { answer.seen.back().keypoint = -1; });
  ExpectRefused<PoseEstimate>([](PoseEstimate& pose) { pose.relocalized_by.value = -2; });
  ExpectRefused<MapFileHeader>([](MapFileHeader& header) { header.num_pages = 0; });
  ExpectRefused<MapFileHeader>([](MapFileHeader& header) { header.num_keyframes = -1; });
  ExpectRefused<MapFileHeader>([](MapFileHeader& header) { header.num_landmarks = -1; });
  ExpectRefused<MapFileHeader>([](MapFileHeader& header) { header.camera.fx_px = 0.0; });
}

TEST(Codec, ScalesAndLoopsOfTheMapOutOfRangeAreRefused) {
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.new_keyframes[0].scale = 0.0; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.moved_keyframes[0].scale = -1.0; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.moved_keyframes[0].scale = kNan; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.closed_loops[0].scale = 0.0; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.closed_loops[0].current.value = -1; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.closed_loops[0].matched.value = -1; });
  ExpectRefused<MapDelta>([](MapDelta& delta) { delta.closed_loops[0].num_points = -1; });
}

// A part must not go on with a value of another keyframe or frame.
template <class Value>
void ExpectPartsHoldTogether(void (*change)(Value& value)) {
  std::mt19937 generator(7);
  const Value first = DrawValue<Value>(generator, 1);
  Value second = first;
  change(second);
  std::vector<Bytes> mixed = Encode(first, 1380);
  ASSERT_GE(mixed.size(), 3U) << TypeName<Value>();
  mixed[1] = Encode(second, 1380)[1];
  Value decoded;
  EXPECT_NE(Decode(mixed, &decoded), "") << TypeName<Value>();
}

TEST(Codec, PartsOfDifferentLoopsAreNotMixed) {
  ExpectPartsHoldTogether<LoopResult>([](LoopResult& result) { ++result.answers.value; });
  ExpectPartsHoldTogether<GlobalAdjustment>([](GlobalAdjustment& adjustment) { ++adjustment.answers.value; });
  ExpectPartsHoldTogether<GlobalAdjustment>([](GlobalAdjustment& adjustment) { ++adjustment.delta; });
  ExpectPartsHoldTogether<RelocalizationRequest>(
      [](RelocalizationRequest& request) { ++request.features.frame.value; });
  ExpectPartsHoldTogether<RelocalizationAnswer>([](RelocalizationAnswer& answer) { ++answer.frame.value; });
}

// A keyframe must not go on in a message of another one.
TEST(Codec, KeyframesOfTheMapAreWhole) {
  std::mt19937 generator(6);
  const MapDelta delta = DrawValue<MapDelta>(generator, 1);
  std::vector<Bytes> messages = Encode(delta, 10000);
  ASSERT_GT(messages.size(), 10U);
  MapDelta decoded;
  std::swap(messages[1], messages[2]);
  EXPECT_NE(Decode(messages, &decoded), "");
}

// Lists are dealt out as their items fit: no part but the last has room for another item of the largest kind.
TEST(Codec, PartsAreFull) {
  std::mt19937 generator(8);
  const auto adjustment = DrawValue<GlobalAdjustment>(generator, 1);
  const std::vector<Bytes> messages = Encode(adjustment, 1380);
  ASSERT_GE(messages.size(), 3U);
  constexpr size_t kBytesOfPose = 8 + 7 * 8;  // keyframe_pose_t
  for (size_t i = 0; i + 1 < messages.size(); ++i) EXPECT_GT(messages[i].size() + kBytesOfPose, 1380U) << i;
}

// Figures that find no room are left out: tools read a status without joining parts.
TEST(Codec, AStatusIsOneMessage) {
  StageStatus status{.name = "mapper", .epoch_us = 1};
  for (int i = 0; i < 200; ++i) status.values.emplace_back("figure_" + std::to_string(i), i);
  const std::vector<Bytes> messages = Encode(status, 1380);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_LE(messages[0].size(), 1380U);
  StageStatus decoded;
  ASSERT_EQ(Decode(messages, &decoded), "");
  EXPECT_GT(decoded.values.size(), 20U);
  EXPECT_LT(decoded.values.size(), 200U);
}

TEST(Codec, HeadersOutOfRangeAreRefused) {
  const auto is_refused = [](void (*change)(MessageHeader& header)) {
    MessageHeader header = ExampleHeader();
    change(header);
    return !ReadHeader(EncodeValue(EndOfStream{.stage = StageKind::kCamera}, header, 60000)[0]);
  };
  EXPECT_FALSE(is_refused([](MessageHeader&) {}));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.publisher = ""; }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.publisher = std::string(64, 'a'); }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.epoch_us = 0; }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.sequence = -1; }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.sequence = int64_t{1} << 60; }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.publish_us = INT64_MIN; }));
  EXPECT_TRUE(is_refused([](MessageHeader& header) { header.num_parts = 0; }));
}

}  // namespace
}  // namespace tessera
