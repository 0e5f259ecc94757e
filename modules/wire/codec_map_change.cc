#include "wire/codec_map_change.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "wire/codec_keypoints.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

// Of one delta or page; far beyond what a mapper changes at once.
constexpr size_t kMaxItems = size_t{1} << 24;
constexpr size_t kMaxNewKeyframes = size_t{1} << 16;

constexpr size_t kBytesPerPose = 4 * 8 + 3 * 8 + 8;
constexpr size_t kBytesPerLandmark = 8 + 3 * 8 + 3 * 8 + 8 + 8 + 32;
constexpr size_t kBytesPerObservation = 8 + 8 + 4;
constexpr size_t kBytesPerLoop = 8 + 8 + 8 + 4;

bool IsWhole(const MapDelta::NewKeyframe& keyframe, int32_t num_total) {
  return keyframe.features->keypoints.size() == static_cast<size_t>(num_total);
}

// The first `num` items. Generated decoders leave what an array held before when its new length is 0.
template <class Item>
std::span<const Item> First(const std::vector<Item>& items, int32_t num) {
  return std::span(items).first(static_cast<size_t>(num));
}

class ChangeJoiner {
 public:
  ChangeJoiner(const map_change_t& change, MapDelta* delta) : change_(change), delta_(*delta) {}

  std::string Join(bool is_last) {
    return FirstProblem(
        {JoinKeyframes(is_last), JoinMoved(), JoinLandmarks(),
         JoinObservations(First(change_.removed_observations, change_.num_removed_observations),
                          &delta_.removed_observations),
         JoinObservations(First(change_.new_observations, change_.num_new_observations), &delta_.new_observations),
         JoinParents(), JoinRemoved(), JoinLoops(),
         SentenceUnless(NumItems() <= kMaxItems, "it changes more than any mapper would")});
  }

 private:
  std::string JoinKeyframes(bool is_last) {
    const auto messages = First(change_.new_keyframes, change_.num_new_keyframes);
    for (const map_keyframe_t& message : messages) {
      const bool begins = message.keypoints.first == 0;
      if (begins) {
        if (delta_.new_keyframes.size() >= kMaxNewKeyframes) return "it brings more keyframes than any mapper would";
        delta_.new_keyframes.push_back(
            {{message.keyframe}, {message.parent}, {}, std::make_shared<FeatureFrame>(), message.scale});
      }
      if (delta_.new_keyframes.empty() || delta_.new_keyframes.back().id.value != message.keyframe) {
        return "the parts of its keyframes do not fit together";
      }
      MapDelta::NewKeyframe& added = delta_.new_keyframes.back();
      // Made above, and shared with nobody yet.
      const auto features = std::const_pointer_cast<FeatureFrame>(added.features);
      const std::string problem = FirstProblem(
          {SentenceUnless(message.keyframe >= 0 && message.parent >= -1, "a keyframe's number is out of range"),
           FromMessage(message.world_from_camera, &added.world_from_camera), CheckScale(message.scale),
           JoinKeypoints(message.keypoints, begins, features.get())});
      if (!problem.empty()) return problem;
      const bool may_go_on = !is_last && &message == &messages.back();
      if (!may_go_on && !IsWhole(added, message.keypoints.num_total)) return "a keyframe lacks keypoints";
    }
    return "";
  }

  std::string JoinMoved() {
    for (size_t i = 0; i < static_cast<size_t>(change_.num_moved_keyframes); ++i) {
      MapDelta::MovedKeyframe& moved = delta_.moved_keyframes.emplace_back();
      moved.id.value = change_.moved_keyframes[i];
      moved.scale = change_.scale[i];
      const std::string problem =
          FirstProblem({FromMessage(change_.world_from_camera[i], &moved.world_from_camera), CheckScale(moved.scale)});
      if (!problem.empty()) return problem;
    }
    return "";
  }

  std::string JoinLandmarks() {
    for (const map_landmark_t& message : First(change_.landmarks, change_.num_landmarks)) {
      auto& [id, landmark] = delta_.changed_landmarks.emplace_back();
      id.value = message.landmark;
      landmark.min_distance = message.min_distance;
      landmark.max_distance = message.max_distance;
      landmark.descriptor = FromMessage(message.descriptor);
      if (message.landmark < 0 || !FromMessage(message.position_in_world, &landmark.position_in_world) ||
          !FromMessage(message.normal, &landmark.normal) || !std::isfinite(message.min_distance) ||
          !std::isfinite(message.max_distance)) {
        return "a landmark is out of range";
      }
    }
    return "";
  }

  std::string JoinObservations(std::span<const map_observation_t> messages,
                               std::vector<MapDelta::ChangedObservation>* observations) {
    for (const map_observation_t& message : messages) {
      if (message.landmark < 0 || message.keyframe < 0 || message.keypoint < 0) return "an observation is out of range";
      observations->push_back({{message.landmark}, {{message.keyframe}, message.keypoint}});
    }
    return "";
  }

  std::string JoinParents() {
    for (size_t i = 0; i < static_cast<size_t>(change_.num_changed_parents); ++i) {
      if (change_.children[i] < 0 || change_.parents[i] < -1) return "a parent's number is out of range";
      delta_.changed_parents.push_back({{change_.children[i]}, {change_.parents[i]}});
    }
    return "";
  }

  std::string JoinRemoved() {
    for (const int64_t id : First(change_.removed_landmarks, change_.num_removed_landmarks)) {
      delta_.removed_landmarks.push_back({id});
    }
    for (const int64_t id : First(change_.removed_keyframes, change_.num_removed_keyframes)) {
      delta_.removed_keyframes.push_back({id});
    }
    return "";
  }

  std::string JoinLoops() {
    for (const closed_loop_t& loop : First(change_.closed_loops, change_.num_closed_loops)) {
      if (loop.current < 0 || loop.matched < 0 || loop.num_points < 0 || !CheckScale(loop.scale).empty()) {
        return "a closed loop is out of range";
      }
      delta_.closed_loops.push_back({{loop.current}, {loop.matched}, loop.scale, loop.num_points});
    }
    return "";
  }

  size_t NumItems() const {
    return delta_.moved_keyframes.size() + delta_.changed_landmarks.size() + delta_.removed_observations.size() +
           delta_.new_observations.size() + delta_.changed_parents.size() + delta_.removed_landmarks.size() +
           delta_.removed_keyframes.size() + delta_.closed_loops.size();
  }

  const map_change_t& change_;
  MapDelta& delta_;
};

}  // namespace

class ChangeCutter::Impl {
 public:
  explicit Impl(const MapDelta& delta) : delta_(delta) {}

  void Fill(size_t room, map_change_t* change) {
    *change = {};
    room_ = std::max(room, kLargestItem);
    FillKeyframes(change);
    Move(delta_.moved_keyframes, 8 + kBytesPerPose, &moved_, [&](const MapDelta::MovedKeyframe& moved) {
      change->moved_keyframes.push_back(moved.id.value);
      change->world_from_camera.push_back(ToMessage(moved.world_from_camera));
      change->scale.push_back(moved.scale);
    });
    Move(delta_.changed_landmarks, kBytesPerLandmark, &landmarks_,
         [&](const MapDelta::ChangedLandmark& changed) { change->landmarks.push_back(LandmarkMessage(changed)); });
    Move(delta_.removed_observations, kBytesPerObservation, &removed_observations_,
         [&](const auto& removed) { change->removed_observations.push_back(ObservationMessage(removed)); });
    Move(delta_.new_observations, kBytesPerObservation, &new_observations_,
         [&](const auto& added) { change->new_observations.push_back(ObservationMessage(added)); });
    Move(delta_.changed_parents, 8 + 8, &parents_, [&](const MapDelta::ChangedParent& changed) {
      change->children.push_back(changed.id.value);
      change->parents.push_back(changed.parent.value);
    });
    Move(delta_.removed_landmarks, 8, &removed_landmarks_,
         [&](LandmarkId id) { change->removed_landmarks.push_back(id.value); });
    Move(delta_.removed_keyframes, 8, &removed_keyframes_,
         [&](KeyframeId id) { change->removed_keyframes.push_back(id.value); });
    Move(delta_.closed_loops, kBytesPerLoop, &closed_loops_, [&](const ClosedLoop& loop) {
      closed_loop_t& message = change->closed_loops.emplace_back();
      message.current = loop.current.value;
      message.matched = loop.matched.value;
      message.scale = loop.scale;
      message.num_points = loop.num_points;
    });
    SetCounts(change);
  }

  bool done() const { return is_done_; }

 private:
  static constexpr size_t kLargestItem = 500;  // a keyframe with one keypoint

  // An item goes only when all lists before it are through: the order is part of the meaning.
  template <class Item, class Put>
  void Move(const std::vector<Item>& items, size_t bytes_per_item, size_t* next, Put put) {
    if (!is_done_) return;
    while (*next < items.size() && room_ >= bytes_per_item) {
      put(items[(*next)++]);
      room_ -= bytes_per_item;
    }
    is_done_ = *next == items.size();
  }

  void FillKeyframes(map_change_t* change) {
    while (keyframe_ < delta_.new_keyframes.size()) {
      const MapDelta::NewKeyframe& added = delta_.new_keyframes[keyframe_];
      map_keyframe_t message{};
      message.keyframe = added.id.value;
      message.parent = added.parent.value;
      message.world_from_camera = ToMessage(added.world_from_camera);
      message.scale = added.scale;
      SetFrame(*added.features, &message.keypoints);
      const auto overhead = static_cast<size_t>(message._getEncodedSizeNoHash());
      const size_t num_left = added.features->keypoints.size() - keypoint_;
      const size_t num = std::min(num_left, (room_ - std::min(room_, overhead)) / kBytesPerKeypoint);
      if (room_ < overhead || (num == 0 && num_left > 0)) break;
      FillKeypoints(*added.features, keypoint_, num, &message.keypoints);
      change->new_keyframes.push_back(std::move(message));
      room_ -= overhead + num * kBytesPerKeypoint;
      keypoint_ += num;
      if (num < num_left) break;
      ++keyframe_;
      keypoint_ = 0;
    }
    is_done_ = keyframe_ == delta_.new_keyframes.size();
  }

  static map_landmark_t LandmarkMessage(const MapDelta::ChangedLandmark& changed) {
    map_landmark_t message;
    message.landmark = changed.id.value;
    ToMessage(changed.landmark.position_in_world, message.position_in_world);
    ToMessage(changed.landmark.normal, message.normal);
    message.min_distance = changed.landmark.min_distance;
    message.max_distance = changed.landmark.max_distance;
    message.descriptor = ToMessage(changed.landmark.descriptor);
    return message;
  }
  static map_observation_t ObservationMessage(const MapDelta::ChangedObservation& changed) {
    map_observation_t message;
    message.landmark = changed.landmark.value;
    message.keyframe = changed.observation.keyframe.value;
    message.keypoint = changed.observation.keypoint;
    return message;
  }
  static void SetCounts(map_change_t* change) {
    const auto count = [](const auto& list) { return static_cast<int32_t>(list.size()); };
    change->num_new_keyframes = count(change->new_keyframes);
    change->num_moved_keyframes = count(change->moved_keyframes);
    change->num_landmarks = count(change->landmarks);
    change->num_removed_observations = count(change->removed_observations);
    change->num_new_observations = count(change->new_observations);
    change->num_changed_parents = count(change->children);
    change->num_removed_landmarks = count(change->removed_landmarks);
    change->num_removed_keyframes = count(change->removed_keyframes);
    change->num_closed_loops = count(change->closed_loops);
  }

  const MapDelta& delta_;
  size_t room_ = 0;
  bool is_done_ = true;  // with all lists so far
  size_t keyframe_ = 0, keypoint_ = 0, moved_ = 0, landmarks_ = 0, removed_observations_ = 0, new_observations_ = 0,
         parents_ = 0, removed_landmarks_ = 0, removed_keyframes_ = 0, closed_loops_ = 0;
};

ChangeCutter::ChangeCutter(const MapDelta& delta) : impl_(std::make_unique<Impl>(delta)) {}
ChangeCutter::~ChangeCutter() = default;
void ChangeCutter::Fill(size_t room, map_change_t* change) { impl_->Fill(room, change); }
bool ChangeCutter::done() const { return impl_->done(); }

std::string JoinChange(const map_change_t& change, bool is_last, MapDelta* delta) {
  return ChangeJoiner(change, delta).Join(is_last);
}

}  // namespace tessera
