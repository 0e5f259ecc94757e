// The one list of what stages exchange: whoever adds a type adds it here, and its codec to codec.h.
#pragma once

// Expands X(Type) for every type that a stage may advertise and subscribe.
#define TESSERA_FOR_EACH_VALUE_TYPE(X) \
  X(CameraFrame)                       \
  X(CameraCalibration)                 \
  X(GroundTruthPose)                   \
  X(EndOfStream)                       \
  X(TileJob)                           \
  X(TileFeatures)                      \
  X(TileAck)                           \
  X(FeatureFrame)                      \
  X(PoseEstimate)                      \
  X(KeyframeObservation)               \
  X(MapDelta)                          \
  X(MapRequest)                        \
  X(MapSnapshotPage)                   \
  X(RemovedInDelta)                    \
  X(LoopResult)                        \
  X(GlobalAdjustment)                  \
  X(RelocalizationRequest)             \
  X(RelocalizationAnswer)              \
  X(ExtractorReady)                    \
  X(StageStatus)
