// What the occupancy stage does with everything that reaches it: images, poses, keyframes and changes of the map in, an
// occupancy map out. No bus, no clock.
//
// The map holds the scan of every keyframe of the largest map part (of two as large, the older one), also of those that
// were removed from the map later, where their links say. While the run goes on, a scan is moved when its keyframe has
// moved by about a voxel; at the end, all are where their keyframes are, to the last bit. So the result is a function
// of the keyframes alone, however far behind the stage was, as long as it got their images. Of mono, a scan is made of
// the landmarks that a keyframe observes, and images are not needed.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/scratch_file.h"
#include "geometry/camera_frame.h"
#include "map/map.h"
#include "map/removed_keyframes.h"
#include "messages/tracking_types.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/waiting_image.h"

namespace tessera {

struct OccupancySessionOptions {
  OccupancyOptions map;        // what is 0 there is filled in by the sensor
  int max_disparity_px = 128;  // stereo: as features.max_disparity_px
  // Images that are kept in memory: they wait until it is known whether their frame becomes a keyframe, and then until
  // they are made into scans. Those of keyframes beyond half of it wait in a file of `scratch_dir`, as far as the disk
  // has room. More are dropped.
  int64_t max_image_bytes = int64_t{256} << 20;
  std::string scratch_dir;  // empty: none wait there
  // The camera tells each keyframe's color, or that it has none: scans wait for it.
  bool with_color = false;
};

class OccupancySession {
 public:
  explicit OccupancySession(const OccupancySessionOptions& options);

  void Receive(const CameraFrame& frame);
  void Receive(const ColorFrame& color);
  void Receive(const PoseEstimate& pose);
  // Fails where the settings do not fit the sensor.
  Result<> Receive(const KeyframeObservation& keyframe);
  void Receive(const RemovedInDelta& removed);
  // The next delta, or a snapshot in place of those before it. Fails as Map::Apply does: then a snapshot is needed.
  Result<> Receive(const MapDelta& delta);
  // The map will not change any more: from now on everything is put where it belongs exactly.
  void EndMap();
  // The tracker has sent so many keyframes, and no more.
  void ExpectKeyframes(int64_t num) { num_expected_ = num; }
  // What has not come will not come any more.
  void GiveUp() { has_given_up_ = true; }

  // Takes one step, which casts the rays of one or two scans or matches one pair of images; false if there is nothing
  // to do.
  bool Advance();
  // Everything came, or was given up, and is in its final place.
  bool is_done() const;

  // Null before the first keyframe, which tells the sensor.
  const OccupancyMap* occupancy() const { return occupancy_ ? &*occupancy_ : nullptr; }
  OccupancyMap* occupancy() { return occupancy_ ? &*occupancy_ : nullptr; }
  // Where its scans were cast, by keyframe.
  std::vector<Rigid3> Path() const;
  // Keyframes that the tracker sent, but whose images did not come.
  int64_t num_without_scan() const;
  // Scans that are to be added, moved or removed, as far as is known, and images that are kept.
  int64_t num_waiting() const { return static_cast<int64_t>(plan_.size() + images_.size()); }

 private:
  struct SentKeyframe {
    KeyframeId id;
    RightShift right_shift;  // by which its columns had been moved
  };

  template <class Images>
  bool SpillToDisk(WaitingImage<Images>& waiting);
  template <class Images>
  void Forget(const WaitingImage<Images>& waiting);
  bool HasScan(FrameId frame) const;
  std::optional<FrameId> FindImage() const;
  ColorImage TakeColor(FrameId frame);
  void ColorKeypoints(FrameId frame);
  bool MakeScan();
  void Plan();
  void Place(KeyframeId id);
  std::set<KeyframeId> MainPart() const;
  std::optional<Rigid3> TargetOf(KeyframeId id, const std::set<KeyframeId>& main_part) const;
  OccupancyMap::SharedScan ScanOf(KeyframeId id) const;
  bool IsInPlace(const OccupancyMap::Placed& placed, const Rigid3& target, KeyframeId id) const;
  bool IsMono() const { return camera_ && camera_->sensor == SensorType::kMono; }

  const OccupancySessionOptions options_;
  Map replica_;
  RemovedKeyframes removed_;
  std::optional<CameraCalibration> camera_;
  std::optional<OccupancyMap> occupancy_;

  FrameId last_decided_;  // POSE has told of the frames up to this one whether they are keyframes
  // Of keyframes, and of frames that may become one.
  std::map<FrameId, WaitingImage<CameraFrame>> images_;
  int64_t image_bytes_ = 0;               // in memory
  std::unique_ptr<ScratchFile> scratch_;  // null: there is none
  std::map<FrameId, SentKeyframe> sent_;  // by the tracker
  std::set<FrameId> announced_;           // by POSE, and not yet sent
  // That came; empty from when they are used.
  std::map<FrameId, WaitingImage<ColorImage>> colors_;
  // Mono: keypoints of keyframes whose colors did not come yet, and the colors of keypoints.
  std::map<FrameId, std::vector<Keypoint>> uncolored_;
  std::map<KeyframeId, std::vector<Rgb>> keypoint_colors_;
  std::map<KeyframeId, OccupancyMap::SharedScan> scans_;

  int64_t num_expected_ = 0;  // keyframes; fewer than that were not all received
  bool has_map_changed_ = false;
  bool has_map_ended_ = false;
  bool has_given_up_ = false;
  std::deque<KeyframeId> plan_;           // whose scans are to be placed next
  std::map<KeyframeId, Rigid3> targets_;  // where scans belong, when plan_ was made
};

}  // namespace tessera
