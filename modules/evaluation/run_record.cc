#include "evaluation/run_record.h"

#include <algorithm>

#include "core/sha256.h"
#include "map/spanning_tree.h"

namespace tessera {
namespace {

void AddPoseBits(const Rigid3& pose, Sha256& hash) {
  for (const double number : {pose.translation.x(), pose.translation.y(), pose.translation.z(), pose.rotation.x(),
                              pose.rotation.y(), pose.rotation.z(), pose.rotation.w()}) {
    hash.Add(number);
  }
}

}  // namespace

void RunRecord::AddPose(const PoseEstimate& pose, int64_t publish_us) {
  poses_.try_emplace(pose.frame, pose, publish_us);
  if (pose.is_keyframe) colors_.Expect(pose.frame);
}

Result<> RunRecord::ApplyDelta(const MapDelta& delta) {
  removed_.Remember(map_, delta);
  colors_.Receive(delta);
  return map_.Apply(delta);
}

void RunRecord::AddRemoved(const RemovedInDelta& removed) {
  for (const KeyframeLink& link : removed.links) removed_.Add(link);
}

void RunRecord::AddGroundTruth(const GroundTruthPose& truth) {
  truth_.try_emplace(truth.frame, truth.frame, truth.utime_us, truth.world_from_camera);
}

void RunRecord::SetStage(const std::string& name, const StageRecord& figures) { stages_[name] = figures; }

void RunRecord::SetEnd(int64_t num_frames, int64_t num_dropped) {
  end_num_frames_ = num_frames;
  end_num_dropped_ = num_dropped;
}

void RunRecord::SetSource(int64_t first_frame, int64_t num_frames) { source_frames_.emplace(first_frame, num_frames); }

std::vector<FrameRecord> RunRecord::Frames() const {
  std::vector<FrameRecord> frames;
  for (const auto& [id, pose] : poses_) {
    FrameRecord frame{pose.estimate, pose.publish_us, std::nullopt, std::nullopt, std::nullopt};
    frame.map_wait_ms = 1e-3 * static_cast<double>(pose.estimate.map_wait_us);
    if (!frames.empty()) {
      frame.pose_time_ms = 1e-3 * static_cast<double>(pose.publish_us - frames.back().publish_us);
    }
    if (pose.estimate.captured_us > 0) {
      frame.latency_ms = 1e-3 * static_cast<double>(pose.publish_us - pose.estimate.captured_us);
    }
    frames.push_back(frame);
  }
  return frames;
}

FrameCounts RunRecord::Counts() const {
  FrameCounts counts;
  TrackingState before = TrackingState::kInitializing;
  for (const auto& [id, pose] : poses_) {
    const TrackingState state = pose.estimate.state;
    if (state == TrackingState::kTracked) {
      ++counts.tracked;
      counts.relocalizations += pose.estimate.is_relocalized ? 1 : 0;
    } else if (counts.tracked == 0) {
      ++counts.initializing;
    } else {
      ++counts.lost;
    }
    // One that was relocalized within the same frame was lost all the same.
    const bool is_lost = state == TrackingState::kLost || pose.estimate.is_relocalized;
    if (is_lost && before == TrackingState::kTracked) {
      ++counts.tracking_failures;
    }
    before = state;
  }
  if (end_num_dropped_) {
    counts.dropped = *end_num_dropped_;
  } else {
    for (const auto& [name, figures] : stages_) {
      counts.dropped += figures.num_dropped;
    }
  }
  counts.frames = static_cast<int64_t>(poses_.size()) + counts.dropped;
  if (source_frames_ && end_num_dropped_) {
    const auto [first_sent, end] = *source_frames_;
    const int64_t first = poses_.empty() ? first_sent : std::min(first_sent, poses_.begin()->first.value);
    counts.missing = std::max<int64_t>(0, end - first - counts.frames);
  }
  return counts;
}

StampedPose RunRecord::FinalPose(const PoseEstimate& estimate) const {
  const std::optional<Sim3> world_from_reference = removed_.Find(map_, estimate.reference_keyframe);
  return {estimate.frame, estimate.utime_us,
          world_from_reference ? (*world_from_reference * estimate.reference_from_camera).Pose()
                               : estimate.world_from_camera};
}

std::vector<StampedPose> RunRecord::Trajectory() const {
  std::vector<StampedPose> trajectory;
  for (const auto& [id, pose] : poses_) {
    if (pose.estimate.state == TrackingState::kTracked) {
      trajectory.push_back(FinalPose(pose.estimate));
    }
  }
  return trajectory;
}

std::vector<StampedPose> RunRecord::LiveTrajectory() const {
  std::vector<StampedPose> trajectory;
  for (const auto& [id, pose] : poses_) {
    if (pose.estimate.state == TrackingState::kTracked) {
      trajectory.push_back({id, pose.estimate.utime_us, pose.estimate.world_from_camera});
    }
  }
  return trajectory;
}

std::vector<Rigid3> RunRecord::PosePerFrame() const {
  if (poses_.empty()) {
    return {};
  }
  // Frames are numbered without gaps up to the end, so that their count tells the first one's number.
  const int64_t sent = source_frames_ ? source_frames_->second : 0;  // the last of which may have been dropped
  const int64_t end = std::max({end_num_frames_.value_or(0), sent, poses_.rbegin()->first.value + 1});
  const int64_t first = std::clamp<int64_t>(end - Counts().frames, 0, poses_.begin()->first.value);
  std::vector<Rigid3> rows;
  Rigid3 last;
  for (int64_t frame = first; frame < end; ++frame) {
    const auto pose = poses_.find(FrameId{frame});
    if (pose != poses_.end() && pose->second.estimate.state == TrackingState::kTracked) {
      last = FinalPose(pose->second.estimate).world_from_camera;
    }
    rows.push_back(last);
  }
  return rows;
}

std::vector<StampedPose> RunRecord::Keyframes() const {
  std::vector<StampedPose> keyframes;
  map_.keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) {
    keyframes.push_back({keyframe.features->frame, keyframe.features->utime_us, keyframe.world_from_camera});
  });
  return keyframes;
}

std::vector<PartRecord> RunRecord::Parts() const {
  std::vector<PartRecord> parts;
  std::map<KeyframeId, size_t> part_of;
  for (const KeyframeId root : Roots(map_)) {
    const std::vector<KeyframeId> keyframes = MapPartOf(map_, root);
    for (const KeyframeId id : keyframes) part_of.emplace(id, parts.size());
    parts.push_back({.num_keyframes = static_cast<int64_t>(keyframes.size())});
  }
  for (const auto& [id, pose] : poses_) {
    const auto part = part_of.find(removed_.Successor(map_, pose.estimate.reference_keyframe));
    if (pose.estimate.state != TrackingState::kTracked || part == part_of.end()) continue;
    PartRecord& record = parts[part->second];
    record.last = FinalPose(pose.estimate);
    if (!record.first) record.first = record.last;
    ++record.num_frames;
  }
  const auto main = std::ranges::max_element(parts, {}, &PartRecord::num_keyframes);  // the first of several
  if (main != parts.end()) main->is_main = true;
  return parts;
}

std::vector<StampedPose> RunRecord::GroundTruth() const {
  std::vector<StampedPose> truth;
  for (const auto& [frame, pose] : truth_) {
    truth.push_back(pose);
  }
  return truth;
}

std::string RunRecord::TrajectorySha256() const {
  Sha256 hash;
  for (const StampedPose& pose : Trajectory()) {
    hash.Add(pose.frame.value);
    hash.Add(pose.utime_us);
    AddPoseBits(pose.world_from_camera, hash);
  }
  return hash.HexDigest();
}

}  // namespace tessera
