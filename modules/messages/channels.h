// The names of all channels, and the bus each one lives on. lcmtypes/README.md says what they carry.
#pragma once

#include <string>

namespace tessera {

// Each bus is one LCM multicast group and port. A process receives a copy of everything on a bus it listens to, so
// pixels and candidates have buses of their own.
enum class BusKind {
  kMain,    // everything small; FEATURES. All processes listen. The stock tools' default
  kCamera,  // CAMERA. Only the dispatcher and the recorder listen
  kWork,    // TILE_FEATURES. Only the reassembler and the recorder listen
  kTile,    // TILE_<n>: one bus for each extractor, which alone listens
};

struct Channel {
  std::string name;
  BusKind bus = BusKind::kMain;
  int extractor = -1;  // kTile: whose bus
};

inline const Channel kCameraChannel{"CAMERA", BusKind::kCamera};
inline const Channel kCalibrationChannel{"CALIBRATION", BusKind::kMain};
inline const Channel kGroundTruthChannel{"GROUND_TRUTH", BusKind::kMain};
inline const Channel kEndOfStreamChannel{"END_OF_STREAM", BusKind::kMain};
inline const Channel kExtractorReadyChannel{"EXTRACTOR_READY", BusKind::kMain};
inline const Channel kTileAckChannel{"TILE_ACK", BusKind::kMain};
inline const Channel kTileFeaturesChannel{"TILE_FEATURES", BusKind::kWork};
inline const Channel kFeaturesChannel{"FEATURES", BusKind::kMain};
inline const Channel kPoseChannel{"POSE", BusKind::kMain};
inline const Channel kKeyframeChannel{"KEYFRAME", BusKind::kMain};
inline const Channel kMapDeltaChannel{"MAP_DELTA", BusKind::kMain};
inline const Channel kMapRequestChannel{"MAP_REQUEST", BusKind::kMain};
inline const Channel kMapSnapshotChannel{"MAP_SNAPSHOT", BusKind::kMain};
inline const Channel kRemovedKeyframesChannel{"REMOVED_KEYFRAMES", BusKind::kMain};
inline const Channel kLoopResultChannel{"LOOP_RESULT", BusKind::kMain};
inline const Channel kGlobalAdjustmentChannel{"GLOBAL_ADJUSTMENT", BusKind::kMain};
inline const Channel kRelocalizationRequestChannel{"RELOCALIZATION_REQUEST", BusKind::kMain};
inline const Channel kRelocalizationChannel{"RELOCALIZATION", BusKind::kMain};
inline const Channel kStatusChannel{"STATUS", BusKind::kMain};
inline const Channel kHeartbeatChannel{"HEARTBEAT", BusKind::kMain};
inline const Channel kRepairChannel{"REPAIR", BusKind::kMain};

inline constexpr int kMaxRobots = 64;        // that share one extractor
inline constexpr int kMaxExtractors = 1024;  // ids are 0 .. kMaxExtractors - 1: each has a port of its own

inline Channel TileChannel(int extractor) { return {"TILE_" + std::to_string(extractor), BusKind::kTile, extractor}; }

}  // namespace tessera
