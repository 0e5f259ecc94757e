// All channels: what each one carries, on which bus, how, and from how many publishers. Whoever adds a channel adds it
// here, and the codec of a new value type to wire/codec_*.cc. lcmtypes/README.md describes the messages.
#pragma once

#include <string>

#include "features/feature_types.h"
#include "geometry/camera_frame.h"
#include "map/map_exchange.h"
#include "map/removed_keyframes.h"
#include "messages/end_of_stream.h"
#include "messages/loop_types.h"
#include "messages/occupancy_types.h"
#include "messages/stage_messages.h"
#include "messages/stream_messages.h"
#include "messages/tracking_types.h"

namespace tessera {

// Each bus is one LCM multicast group and port. A process receives a copy of everything on a bus it listens to, so
// pixels and candidates have buses of their own.
enum class BusKind {
  kMain,    // everything small. All processes listen. The stock tools' default
  kCamera,  // CAMERA. Only the dispatcher, the recorder and the occupancy stage listen
  kColor,   // COLOR. What shows or colors something listens, and the recorder. The camera bus unless bus.color_url is
            // set
  kWork,    // TILE_FEATURES. Only the reassembler and the recorder listen
  kMap,     // FEATURES, keyframes, the map. What handles images doesn't listen. The main bus unless bus.map_url is set
  kTile,    // TILE_<n>: one bus for each extractor, which alone listens
};

enum class Delivery {
  kFromFirst,  // in order, repaired; a late subscriber gets what the publisher still keeps
  kFromNow,    // in order, repaired; a late subscriber begins with what is sent from then on
  kUnordered,  // as it comes: each value says the whole state
};

enum class Publishers {
  kOne,  // a second publisher at the same time is an error
  kMany,
};

// What becomes of messages that no publisher keeps any longer.
enum class Unrepaired {
  kLost,       // for good: an error
  kRequested,  // their values are asked for in another way
};

// A channel without the type of its values.
struct Channel {
  std::string name;  // without prefix
  BusKind bus = BusKind::kMain;
  Delivery delivery = Delivery::kFromFirst;
  Publishers publishers = Publishers::kOne;
  Unrepaired unrepaired = Unrepaired::kLost;
  int extractor = -1;  // kTile: whose bus
};

// A channel that carries values of one type.
template <class Value>
struct Topic : Channel {};

inline const Topic<CameraFrame> kCamera{"CAMERA", BusKind::kCamera, Delivery::kFromFirst, Publishers::kOne};
inline const Topic<ColorFrame> kColor{"COLOR", BusKind::kColor, Delivery::kFromFirst, Publishers::kOne};
inline const Topic<CameraCalibration> kCalibration{"CALIBRATION", BusKind::kMain, Delivery::kFromFirst,
                                                   Publishers::kOne};
inline const Topic<GroundTruthPose> kGroundTruth{"GROUND_TRUTH", BusKind::kMain, Delivery::kFromFirst,
                                                 Publishers::kOne};
inline const Topic<EndOfStream> kEndOfStream{"END_OF_STREAM", BusKind::kMain, Delivery::kFromFirst, Publishers::kMany};

inline const Topic<ExtractorReady> kExtractorReady{"EXTRACTOR_READY", BusKind::kMain, Delivery::kUnordered,
                                                   Publishers::kMany};
// What a restarted reassembler lacks is extracted again, which is less than all that extractors still keep.
inline const Topic<TileFeatures> kTileFeatures{"TILE_FEATURES", BusKind::kWork, Delivery::kFromNow, Publishers::kMany};
inline const Topic<TileAck> kTileAck{"TILE_ACK", BusKind::kMain, Delivery::kFromFirst, Publishers::kOne};
inline const Topic<FeatureFrame> kFeatures{"FEATURES", BusKind::kMap, Delivery::kFromFirst, Publishers::kOne};

inline const Topic<PoseEstimate> kPose{"POSE", BusKind::kMain, Delivery::kFromFirst, Publishers::kOne};
inline const Topic<KeyframeObservation> kKeyframe{"KEYFRAME", BusKind::kMap, Delivery::kFromFirst, Publishers::kOne};

// A late subscriber, and one that lacks deltas, catches up by MAP_REQUEST (map/map_follower.h).
inline const Topic<MapDelta> kMapDelta{
    {"MAP_DELTA", BusKind::kMap, Delivery::kFromNow, Publishers::kOne, Unrepaired::kRequested}};
inline const Topic<MapRequest> kMapRequest{"MAP_REQUEST", BusKind::kMain, Delivery::kFromNow, Publishers::kMany};
inline const Topic<MapSnapshotPage> kMapSnapshot{
    {"MAP_SNAPSHOT", BusKind::kMap, Delivery::kFromNow, Publishers::kOne, Unrepaired::kRequested}};
inline const Topic<RemovedInDelta> kRemovedKeyframes{"REMOVED_KEYFRAMES", BusKind::kMain, Delivery::kFromFirst,
                                                     Publishers::kOne};

inline const Topic<LoopResult> kLoopResult{"LOOP_RESULT", BusKind::kMain, Delivery::kFromFirst, Publishers::kOne};
inline const Topic<GlobalAdjustment> kGlobalAdjustment{"GLOBAL_ADJUSTMENT", BusKind::kMap, Delivery::kFromFirst,
                                                       Publishers::kOne};
// A tracker that still waits for an answer asks again.
inline const Topic<RelocalizationRequest> kRelocalizationRequest{"RELOCALIZATION_REQUEST", BusKind::kMain,
                                                                 Delivery::kFromNow, Publishers::kOne};
inline const Topic<RelocalizationAnswer> kRelocalization{"RELOCALIZATION", BusKind::kMain, Delivery::kFromFirst,
                                                         Publishers::kOne};

// A late subscriber asks for all blocks instead of the whole history.
inline const Topic<OccupancyUpdate> kOccupancy{"OCCUPANCY", BusKind::kMain, Delivery::kFromNow, Publishers::kOne};
inline const Topic<OccupancyRequest> kOccupancyRequest{"OCCUPANCY_REQUEST", BusKind::kMain, Delivery::kFromNow,
                                                       Publishers::kMany};

inline const Topic<StageStatus> kStatus{"STATUS", BusKind::kMain, Delivery::kUnordered, Publishers::kMany};
inline const Topic<Heartbeat> kHeartbeat{"HEARTBEAT", BusKind::kMain, Delivery::kUnordered, Publishers::kMany};
inline const Topic<RepairRequest> kRepair{"REPAIR", BusKind::kMain, Delivery::kUnordered, Publishers::kMany};

inline constexpr int kMaxRobots = 64;       // that share one extractor
inline constexpr int kMaxExtractors = 256;  // ids are 0 .. kMaxExtractors - 1: each has a port of its own

// The jobs of one extractor. Those of an extractor that died are given to others: its successor must not repeat them.
inline Topic<TileJob> TileTopic(int extractor) {
  return {{"TILE_" + std::to_string(extractor), BusKind::kTile, Delivery::kFromNow, Publishers::kOne, Unrepaired::kLost,
           extractor}};
}

}  // namespace tessera
