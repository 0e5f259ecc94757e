#include "occupancy/occupancy_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "map/landmark_colors.h"
#include "map/spanning_tree.h"

namespace tessera {
namespace {

bool HasImages(const CameraFrame& frame, const CameraCalibration& camera) {
  const auto fits = [&](const auto& image) {
    return image.width == camera.width_px && image.height == camera.height_px;
  };
  return fits(frame.left) && (camera.sensor == SensorType::kRgbd ? fits(frame.depth) : fits(frame.right));
}

// How far the points of a scan are displaced when its camera moves, about: those at half the range.
double Displacement(const Rigid3& from, const Rigid3& to, double range) {
  const double angle_rad = from.rotation.angularDistance(to.rotation);
  return (from.translation - to.translation).norm() + 0.5 * range * angle_rad;
}

}  // namespace

OccupancySession::OccupancySession(const OccupancySessionOptions& options)
    : options_(options),
      scratch_(options.scratch_dir.empty() ? nullptr : std::make_unique<ScratchFile>(options.scratch_dir)) {}

void OccupancySession::Receive(const CameraFrame& frame) {
  if (frame.sensor == SensorType::kMono || images_.contains(frame.id)) return;
  const bool may_be_keyframe = frame.id > last_decided_ || announced_.contains(frame.id) || sent_.contains(frame.id);
  if (!may_be_keyframe || HasScan(frame.id)) return;
  WaitingImage<CameraFrame> waiting{frame, std::nullopt};
  if (image_bytes_ + BytesOf(frame) > options_.max_image_bytes && !SpillToDisk(waiting)) return;
  image_bytes_ += waiting.bytes_in_memory();
  images_.emplace(frame.id, std::move(waiting));
}

// A camera that was started again sends frames again, whose color is used up.
bool OccupancySession::HasScan(FrameId frame) const {
  const auto keyframe = sent_.find(frame);
  return keyframe != sent_.end() && scans_.contains(keyframe->second.id);
}

template <class Images>
bool OccupancySession::SpillToDisk(WaitingImage<Images>& waiting) {
  return scratch_ != nullptr && MoveToDisk(waiting, *scratch_);
}

template <class Images>
void OccupancySession::Forget(const WaitingImage<Images>& waiting) {
  image_bytes_ -= waiting.bytes_in_memory();
  if (waiting.place) scratch_->Drop(*waiting.place);
}

// The first one counts: a camera that was started again tells those of keyframes before once more.
void OccupancySession::Receive(const ColorFrame& color) {
  if (!options_.with_color || colors_.contains(color.id)) return;
  WaitingImage<ColorImage> waiting{color.image, std::nullopt};
  const bool has_room = image_bytes_ + BytesOf(color.image) <= options_.max_image_bytes / 2;
  if (!has_room && !SpillToDisk(waiting) && image_bytes_ + BytesOf(color.image) > options_.max_image_bytes) {
    waiting.images = {};
  }
  image_bytes_ += waiting.bytes_in_memory();
  colors_[color.id] = std::move(waiting);
  ColorKeypoints(color.id);
}

ColorImage OccupancySession::TakeColor(FrameId frame) {
  const auto found = colors_.find(frame);
  if (found == colors_.end()) return {};
  image_bytes_ -= found->second.bytes_in_memory();
  return MoveBack(std::exchange(found->second, {}), scratch_.get()).value_or(ColorImage());
}

// If both the frame's keypoints and its color are there.
void OccupancySession::ColorKeypoints(FrameId frame) {
  const auto keypoints = uncolored_.find(frame);
  if (keypoints == uncolored_.end() || !colors_.contains(frame)) return;
  std::vector<Rgb> colors = ColorsAt(keypoints->second, TakeColor(frame));
  if (!colors.empty()) keypoint_colors_[sent_.at(frame).id] = std::move(colors);
  uncolored_.erase(keypoints);
  has_map_changed_ = true;
}

void OccupancySession::Receive(const PoseEstimate& pose) {
  if (pose.is_keyframe && !sent_.contains(pose.frame)) announced_.insert(pose.frame);
  last_decided_ = std::max(last_decided_, pose.frame);
  for (auto it = images_.begin(); it != images_.end() && it->first <= last_decided_;) {
    auto& [frame, waiting] = *it;
    if (!announced_.contains(frame) && !sent_.contains(frame)) {
      Forget(waiting);
      it = images_.erase(it);
      continue;
    }
    const int64_t num_bytes = waiting.bytes_in_memory();
    if (image_bytes_ > options_.max_image_bytes / 2 && SpillToDisk(waiting)) image_bytes_ -= num_bytes;
    ++it;
  }
}

Result<> OccupancySession::Receive(const KeyframeObservation& keyframe) {
  const FrameId frame = keyframe.features.frame;
  announced_.erase(frame);
  sent_[frame] = {keyframe.id, keyframe.features.calibration.right_shift};
  camera_ = keyframe.features.calibration;
  if (!occupancy_) {
    const OccupancyOptions fitted = FitToSensor(options_.map, *camera_);
    TESSERA_RETURN_IF_FAILED(fitted.Check());
    occupancy_.emplace(fitted);
  }
  if (options_.with_color && IsMono()) {
    uncolored_[frame] = keyframe.features.keypoints;
    ColorKeypoints(frame);
  }
  return {};
}

void OccupancySession::Receive(const RemovedInDelta& removed) {
  for (const KeyframeLink& link : removed.links) removed_.Add(link);
  has_map_changed_ = true;
}

Result<> OccupancySession::Receive(const MapDelta& delta) {
  removed_.Remember(replica_, delta);
  has_map_changed_ = true;
  return replica_.Apply(delta);
}

void OccupancySession::EndMap() {
  has_map_changed_ = has_map_changed_ || !has_map_ended_;
  has_map_ended_ = true;
}

bool OccupancySession::Advance() {
  if (!occupancy_) return false;
  if (MakeScan()) return true;
  if (plan_.empty() && has_map_changed_) Plan();
  if (plan_.empty()) return false;
  const KeyframeId next = plan_.front();
  plan_.pop_front();
  Place(next);
  return true;
}

bool OccupancySession::is_done() const {
  const bool has_all = announced_.empty() && num_without_scan() == 0 && uncolored_.empty() &&
                       static_cast<int64_t>(sent_.size()) >= num_expected_;
  return has_map_ended_ && (has_all || has_given_up_) && !has_map_changed_ && plan_.empty() && !FindImage();
}

std::vector<Rigid3> OccupancySession::Path() const {
  std::vector<Rigid3> path;
  if (!occupancy_) return path;
  for (const auto& [id, placed] : occupancy_->scans()) path.push_back(placed.world_from_camera);
  return path;
}

int64_t OccupancySession::num_without_scan() const {
  return IsMono() ? 0 : static_cast<int64_t>(sent_.size() - scans_.size());
}

// The first frame whose images are there and that is a keyframe.
std::optional<FrameId> OccupancySession::FindImage() const {
  for (const auto& [id, frame] : images_) {
    const bool has_color = !options_.with_color || has_given_up_ || colors_.contains(id);
    if (has_color && sent_.contains(id)) return id;
  }
  return std::nullopt;
}

// False if there is nothing to make one from.
bool OccupancySession::MakeScan() {
  const std::optional<FrameId> id = FindImage();
  if (!id) return false;
  auto waiting = images_.extract(*id);
  image_bytes_ -= waiting.mapped().bytes_in_memory();
  const std::optional<CameraFrame> images = MoveBack(std::move(waiting.mapped()), scratch_.get());
  ColorImage color = TakeColor(*id);
  if (!images || !HasImages(*images, *camera_)) return true;
  if (color.width != camera_->width_px || color.height != camera_->height_px) color = {};
  CameraCalibration camera = *camera_;
  const SentKeyframe& keyframe = sent_.at(*id);
  camera.right_shift = keyframe.right_shift;
  scans_[keyframe.id] = std::make_shared<const Scan>(
      ScanFromImages(*images, color, camera, occupancy_->options(), options_.max_disparity_px));
  has_map_changed_ = true;
  return true;
}

// New scans come first, since they show most. At the end, where most have moved a little, all are cast anew, which is
// half of the work; the result is the same.
void OccupancySession::Plan() {
  has_map_changed_ = false;
  targets_.clear();
  const std::set<KeyframeId> main_part = MainPart();
  std::vector<KeyframeId> gone, added, moved;
  for (const auto& [frame, keyframe] : sent_) {
    const KeyframeId id = keyframe.id;
    const OccupancyMap::Placed* placed = occupancy_->Find(id);
    const std::optional<Rigid3> target = TargetOf(id, main_part);
    if (target) targets_.emplace(id, *target);
    if (!target && placed != nullptr) gone.push_back(id);
    if (target && placed == nullptr) added.push_back(id);
    if (target && placed != nullptr && !IsInPlace(*placed, *target, id)) moved.push_back(id);
  }
  plan_.assign(gone.begin(), gone.end());
  if (has_map_ended_ && 2 * moved.size() > occupancy_->scans().size()) {
    occupancy_->Clear();
    for (const auto& [id, target] : targets_) plan_.push_back(id);
    return;
  }
  plan_.insert(plan_.end(), added.begin(), added.end());
  plan_.insert(plan_.end(), moved.begin(), moved.end());
}

void OccupancySession::Place(KeyframeId id) {
  const auto target = targets_.find(id);
  if (target == targets_.end()) {
    occupancy_->Remove(id);
  } else {
    occupancy_->Put(id, ScanOf(id), target->second);
  }
}

std::set<KeyframeId> OccupancySession::MainPart() const {
  std::vector<KeyframeId> largest;
  for (const KeyframeId root : Roots(replica_)) {
    std::vector<KeyframeId> part = MapPartOf(replica_, root);
    if (part.size() > largest.size()) largest = std::move(part);
  }
  return {largest.begin(), largest.end()};
}

// Where the keyframe's scan belongs; nullopt if it does not belong into the map.
std::optional<Rigid3> OccupancySession::TargetOf(KeyframeId id, const std::set<KeyframeId>& main_part) const {
  if (IsMono() ? replica_.FindKeyframe(id) == nullptr : !scans_.contains(id)) return std::nullopt;
  if (!main_part.contains(removed_.Successor(replica_, id))) return std::nullopt;
  const std::optional<Sim3> world_from_keyframe = removed_.Find(replica_, id);
  return world_from_keyframe ? std::optional(world_from_keyframe->Pose()) : std::nullopt;
}

OccupancyMap::SharedScan OccupancySession::ScanOf(KeyframeId id) const {
  if (!IsMono()) return scans_.at(id);
  const Keyframe* keyframe = replica_.FindKeyframe(id);
  if (keyframe == nullptr) return std::make_shared<const Scan>();
  const auto colors = keypoint_colors_.find(id);
  return std::make_shared<const Scan>(
      ScanFromLandmarks(replica_, *keyframe, colors == keypoint_colors_.end() ? std::vector<Rgb>() : colors->second));
}

bool OccupancySession::IsInPlace(const OccupancyMap::Placed& placed, const Rigid3& target, KeyframeId id) const {
  const Rigid3& now = placed.world_from_camera;
  if (has_map_ended_) {
    return now.rotation.coeffs() == target.rotation.coeffs() && now.translation == target.translation &&
           (!IsMono() || *placed.scan == *ScanOf(id));
  }
  const OccupancyOptions& options = occupancy_->options();
  return Displacement(now, target, options.max_range) <= options.resolution;
}

}  // namespace tessera
