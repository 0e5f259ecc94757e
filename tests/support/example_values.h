// Values of every type that is sent or kept in a file, drawn by a seed, and whether two of them are the same.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "messages/mapper_step.h"
#include "messages/topics.h"
#include "wire/codec.h"
#include "wire/map_file.h"

namespace tessera {

// Draws a valid value. `size`: 0 is the smallest that makes sense, 1 fills several messages.
template <class Value>
Value DrawValue(std::mt19937& generator, int size);

template <class Value>
bool AreSame(const Value& a, const Value& b);

// Calls visit.operator()<Value>() for each type that is sent.
template <class Visit>
void ForEachSentType(Visit visit) {
  visit.template operator()<CameraFrame>();
  visit.template operator()<ColorFrame>();
  visit.template operator()<CameraCalibration>();
  visit.template operator()<GroundTruthPose>();
  visit.template operator()<EndOfStream>();
  visit.template operator()<TileJob>();
  visit.template operator()<TileFeatures>();
  visit.template operator()<TileAck>();
  visit.template operator()<ExtractorReady>();
  visit.template operator()<FeatureFrame>();
  visit.template operator()<KeyframeObservation>();
  visit.template operator()<MapDelta>();
  visit.template operator()<MapSnapshotPage>();
  visit.template operator()<MapRequest>();
  visit.template operator()<RemovedInDelta>();
  visit.template operator()<MapperStep>();
  visit.template operator()<LoopResult>();
  visit.template operator()<GlobalAdjustment>();
  visit.template operator()<RelocalizationRequest>();
  visit.template operator()<RelocalizationAnswer>();
  visit.template operator()<OccupancyUpdate>();
  visit.template operator()<OccupancyRequest>();
  visit.template operator()<PoseEstimate>();
  visit.template operator()<StageStatus>();
  visit.template operator()<Heartbeat>();
  visit.template operator()<RepairRequest>();
}

// The same for these, and what stands in files alone.
template <class Visit>
void ForEachValueType(Visit visit) {
  ForEachSentType(visit);
  visit.template operator()<MapFileHeader>();
}

inline MessageHeader ExampleHeader() {
  return {
      .publisher = "tester_7", .epoch_us = 1'700'000'000'000'000, .sequence = 12, .publish_us = 1'700'000'000'123'456};
}

}  // namespace tessera
