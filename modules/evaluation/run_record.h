// The record of a run: every pose, the ground truth, the map, and the figures of the stages. All files in a run's
// folder are derived from it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/ids.h"
#include "evaluation/statistics.h"
#include "geometry/camera_frame.h"
#include "geometry/rigid3.h"
#include "map/landmark_colors.h"
#include "map/map.h"
#include "map/removed_keyframes.h"
#include "messages/tracking_types.h"

namespace tessera {

struct StampedPose {
  FrameId frame;
  int64_t utime_us = 0;
  Rigid3 world_from_camera;
};

// A frame with a POSE message.
struct FrameRecord {
  PoseEstimate pose;
  int64_t publish_us = 0;              // wall clock at which the pose was published
  std::optional<double> pose_time_ms;  // since the pose before it was published; none for the first
  std::optional<double> latency_ms;    // since the frame was taken; none if unknown
  std::optional<double> map_wait_ms;   // time it waited in the tracker for map deltas
};

struct FrameCounts {
  int64_t frames = 0;  // of the source, as far as is known: those with a pose message, and the dropped ones
  int64_t tracked = 0;
  int64_t initializing = 0;       // without a pose, before the first that has one
  int64_t lost = 0;               // without a pose, after it
  int64_t dropped = 0;            // never reached the tracker
  int64_t missing = 0;            // that the camera sent, and nobody accounts for: no pose, and not told to be dropped
  int64_t tracking_failures = 0;  // changes from tracked to lost, also if the same frame was found again
  int64_t relocalizations = 0;    // changes back, into a part of the map that was there before
};

// A part of the map, and the tracked frames that it places. Poses of two parts can't be compared: nothing joins them.
struct PartRecord {
  int64_t num_keyframes = 0;
  int64_t num_frames = 0;
  std::optional<StampedPose> first, last;  // of the frames; there may be others of another part between them
  bool is_main = false;                    // no part has more keyframes (of two that have as many, the older one)
};

// The latest figures that a stage told.
struct StageRecord {
  Statistics step_ms;
  int64_t num_repaired = 0;              // messages
  int64_t num_lost = 0;                  // messages
  int64_t num_dropped = 0;               // frames
  std::map<std::string, double> values;  // other counters, by name
};

class RunRecord {
 public:
  // A frame counts once: the first pose.
  void AddPose(const PoseEstimate& pose, int64_t publish_us);
  // The next change of the map; fails as Map::Apply does.
  Result<> ApplyDelta(const MapDelta& delta);
  void AddColor(const ColorFrame& color) { colors_.Receive(color); }
  // Keyframes removed from the map, also before the first change received.
  void AddRemoved(const RemovedInDelta& removed);
  void AddGroundTruth(const GroundTruthPose& truth);
  // Replaces earlier figures.
  void SetStage(const std::string& name, const StageRecord& figures);
  // The tracker has seen the end: one past the last frame's number, and how many frames never reached it.
  void SetEnd(int64_t num_frames, int64_t num_dropped);

  // The camera has sent frames first_frame .. num_frames - 1, or was started again and sent those before, too.
  void SetSource(int64_t first_frame, int64_t num_frames);

  bool empty() const { return poses_.empty(); }
  bool HasPose(FrameId frame) const { return poses_.contains(frame); }

  // Frames in order of their numbers.
  std::vector<FrameRecord> Frames() const;
  FrameCounts Counts() const;
  const Map& map() const { return map_; }
  const LandmarkColors& colors() const { return colors_; }
  const std::map<std::string, StageRecord>& stages() const { return stages_; }

  // Tracked frames, where the map puts them at the end, also those whose reference is no longer in it:
  //   world_from_camera = world_from_reference (now) * reference_from_camera (then)
  std::vector<StampedPose> Trajectory() const;
  // Tracked frames as they were published at the time.
  std::vector<StampedPose> LiveTrajectory() const;
  // One pose for every frame of the source: a frame without one takes the last before it; before the first,
  // the origin of the world.
  std::vector<Rigid3> PosePerFrame() const;
  std::vector<StampedPose> Keyframes() const;  // of the map
  std::vector<PartRecord> Parts() const;       // of the map, oldest first
  std::vector<StampedPose> GroundTruth() const;

  // Over the exact bits of Trajectory(): frame, time, tx ty tz qx qy qz qw.
  std::string TrajectorySha256() const;

 private:
  struct Pose {
    PoseEstimate estimate;
    int64_t publish_us = 0;
  };
  StampedPose FinalPose(const PoseEstimate& estimate) const;

  std::map<FrameId, Pose> poses_;
  Map map_;
  LandmarkColors colors_;
  RemovedKeyframes removed_;
  std::map<FrameId, StampedPose> truth_;
  std::map<std::string, StageRecord> stages_;
  std::optional<int64_t> end_num_frames_;
  std::optional<int64_t> end_num_dropped_;
  std::optional<std::pair<int64_t, int64_t>> source_frames_;  // the first, and one past the last
};

}  // namespace tessera
