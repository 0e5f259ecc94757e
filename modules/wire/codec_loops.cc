// LOOP_RESULT, GLOBAL_ADJUSTMENT, RELOCALIZATION_REQUEST, RELOCALIZATION.
#include <algorithm>

#include "messages/loop_types.h"
#include "tessera/global_adjustment_t.hpp"
#include "tessera/loop_result_t.hpp"
#include "tessera/relocalization_request_t.hpp"
#include "tessera/relocalization_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_keypoints.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr size_t kBytesPerSeen = 4 + 8;
constexpr size_t kBytesPerCorrection = 8 + 8 + 4 * 8 + 3 * 8;
constexpr size_t kBytesPerPose = 8 + 4 * 8 + 3 * 8;
constexpr size_t kBytesPerPoint = 8 + 3 * 8;
constexpr size_t kMaxItems = size_t{1} << 24;  // of any list; far beyond what a map holds

// Deals the items of a list out to messages, as many as fit.
template <class Item>
class Dealer {
 public:
  explicit Dealer(const std::vector<Item>& items) : items_(items) {}
  bool done() const { return next_ == items_.size(); }

  template <class Put>
  void Deal(size_t bytes_per_item, size_t* room, Put put) {
    for (; !done() && *room >= bytes_per_item; *room -= bytes_per_item) put(items_[next_++]);
  }

 private:
  const std::vector<Item>& items_;
  size_t next_ = 0;
};

seen_landmark_t MessageOf(const SeenLandmark& seen) {
  seen_landmark_t message;
  message.keypoint = seen.keypoint;
  message.landmark = seen.landmark.value;
  return message;
}

std::string JoinSeen(const std::vector<seen_landmark_t>& messages, int32_t num, std::vector<SeenLandmark>* seen) {
  for (size_t i = 0; i < static_cast<size_t>(num); ++i) {
    if (messages[i].keypoint < 0 || messages[i].landmark < 0) return "a seen landmark is out of range";
    seen->push_back({messages[i].keypoint, {messages[i].landmark}});
  }
  return SentenceUnless(seen->size() <= kMaxItems, "it sees more landmarks than any frame would");
}

}  // namespace

template <>
struct Codec<LoopResult> {
  using Message = loop_result_t;
  static constexpr const char* kTypeName = "loop_result_t";

  template <class Emit>
  static void Cut(const LoopResult& result, Message* message, size_t max_bytes, Emit emit) {
    message->keyframe = result.answers.value;
    message->matched = result.matched.value;
    message->matched_from_current = ToMessage(result.matched_from_current);
    message->joins_parts = result.joins_parts ? 1 : 0;
    message->num_candidates = result.num_candidates;
    message->num_consistent = result.num_consistent;
    message->num_matched = result.num_matched;
    message->num_aligned = result.num_aligned;
    const size_t overhead = static_cast<size_t>(message->getEncodedSize());
    Dealer corrections(result.corrections);
    Dealer seen(result.seen);
    do {
      size_t room = std::max(max_bytes - std::min(max_bytes, overhead), kBytesPerCorrection);
      message->corrections.clear();
      message->seen.clear();
      corrections.Deal(kBytesPerCorrection, &room, [&](const LoopResult::Correction& correction) {
        correction_t& part = message->corrections.emplace_back();
        part.keyframe = correction.id.value;
        part.new_world_from_old = ToMessage(correction.new_world_from_old);
      });
      seen.Deal(kBytesPerSeen, &room, [&](const SeenLandmark& item) { message->seen.push_back(MessageOf(item)); });
      message->num_corrections = static_cast<int32_t>(message->corrections.size());
      message->num_seen = static_cast<int32_t>(message->seen.size());
      emit(*message);
    } while (!corrections.done() || !seen.done());
  }

  static std::string Join(const Message& message, LoopResult* result) {
    if (message.header.part == 0) {
      *result = {};
      result->answers.value = message.keyframe;
      result->matched.value = message.matched;
      result->joins_parts = message.joins_parts != 0;
      result->num_candidates = message.num_candidates;
      result->num_consistent = message.num_consistent;
      result->num_matched = message.num_matched;
      result->num_aligned = message.num_aligned;
    }
    std::string problem =
        FirstProblem({SentenceUnless(message.keyframe >= 0 && message.keyframe == result->answers.value,
                                     "its keyframe is out of range"),
                      SentenceUnless(message.matched >= -1 && message.matched < message.keyframe,
                                     "its matched keyframe is out of range"),
                      FromMessage(message.matched_from_current, &result->matched_from_current),
                      SentenceUnless(message.num_candidates >= 0 && message.num_consistent >= 0 &&
                                         message.num_matched >= 0 && message.num_aligned >= 0,
                                     "one of its counts is negative"),
                      JoinSeen(message.seen, message.num_seen, &result->seen)});
    for (size_t i = 0; problem.empty() && i < static_cast<size_t>(message.num_corrections); ++i) {
      LoopResult::Correction& correction = result->corrections.emplace_back();
      correction.id.value = message.corrections[i].keyframe;
      problem = FirstProblem(
          {SentenceUnless(correction.id.valid(), "a corrected keyframe is out of range"),
           FromMessage(message.corrections[i].new_world_from_old, &correction.new_world_from_old),
           SentenceUnless(result->corrections.size() <= kMaxItems, "it corrects more than any map holds")});
    }
    return problem;
  }
};
TESSERA_CODEC(LoopResult);

template <>
struct Codec<GlobalAdjustment> {
  using Message = global_adjustment_t;
  static constexpr const char* kTypeName = "global_adjustment_t";

  template <class Emit>
  static void Cut(const GlobalAdjustment& adjustment, Message* message, size_t max_bytes, Emit emit) {
    message->keyframe = adjustment.answers.value;
    message->delta = adjustment.delta;
    message->is_usable = adjustment.is_usable ? 1 : 0;
    const size_t overhead = static_cast<size_t>(message->getEncodedSize());
    Dealer poses(adjustment.poses);
    Dealer points(adjustment.points);
    do {
      size_t room = std::max(max_bytes - std::min(max_bytes, overhead), kBytesPerPose);
      message->poses.clear();
      message->points.clear();
      poses.Deal(kBytesPerPose, &room, [&](const GlobalAdjustment::Pose& pose) {
        keyframe_pose_t& part = message->poses.emplace_back();
        part.keyframe = pose.id.value;
        part.world_from_camera = ToMessage(pose.world_from_camera);
      });
      points.Deal(kBytesPerPoint, &room, [&](const GlobalAdjustment::Point& point) {
        landmark_position_t& part = message->points.emplace_back();
        part.landmark = point.id.value;
        ToMessage(point.position_in_world, part.position_in_world);
      });
      message->num_poses = static_cast<int32_t>(message->poses.size());
      message->num_points = static_cast<int32_t>(message->points.size());
      emit(*message);
    } while (!poses.done() || !points.done());
  }

  static std::string Join(const Message& message, GlobalAdjustment* adjustment) {
    if (message.header.part == 0) {
      *adjustment = {};
      adjustment->answers.value = message.keyframe;
      adjustment->delta = message.delta;
      adjustment->is_usable = message.is_usable != 0;
    }
    if (message.keyframe < 0 || message.keyframe != adjustment->answers.value || message.delta < 0 ||
        message.delta != adjustment->delta) {
      return "its keyframe or delta is out of range";
    }
    for (size_t i = 0; i < static_cast<size_t>(message.num_poses); ++i) {
      GlobalAdjustment::Pose& pose = adjustment->poses.emplace_back();
      pose.id.value = message.poses[i].keyframe;
      const std::string problem =
          FirstProblem({SentenceUnless(pose.id.valid(), "a pose's keyframe is out of range"),
                        FromMessage(message.poses[i].world_from_camera, &pose.world_from_camera)});
      if (!problem.empty()) return problem;
    }
    for (size_t i = 0; i < static_cast<size_t>(message.num_points); ++i) {
      GlobalAdjustment::Point& point = adjustment->points.emplace_back();
      point.id.value = message.points[i].landmark;
      if (!point.id.valid() || !FromMessage(message.points[i].position_in_world, &point.position_in_world)) {
        return "a landmark is out of range";
      }
    }
    return SentenceUnless(adjustment->poses.size() <= kMaxItems && adjustment->points.size() <= kMaxItems,
                          "it moves more than any map holds");
  }
};
TESSERA_CODEC(GlobalAdjustment);

template <>
struct Codec<RelocalizationRequest> {
  using Message = relocalization_request_t;
  static constexpr const char* kTypeName = "relocalization_request_t";

  template <class Emit>
  static void Cut(const RelocalizationRequest& request, Message* message, size_t max_bytes, Emit emit) {
    message->last_keyframe = request.last_keyframe.value;
    SetFrame(request.features, &message->keypoints);
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    const size_t per_part = std::max<size_t>(1, (max_bytes - overhead) / kBytesPerKeypoint);
    const size_t num_keypoints = request.features.keypoints.size();
    size_t first = 0;
    do {
      const size_t num = std::min(per_part, num_keypoints - first);
      FillKeypoints(request.features, first, num, &message->keypoints);
      emit(*message);
      first += num;
    } while (first < num_keypoints);
  }

  static std::string Join(const Message& message, RelocalizationRequest* request) {
    const bool begins = message.header.part == 0, is_last = message.header.part + 1 == message.header.num_parts;
    if (begins) request->last_keyframe.value = message.last_keyframe;
    return FirstProblem({SentenceUnless(message.last_keyframe >= -1, "its keyframe is out of range"),
                         JoinKeypoints(message.keypoints, begins, &request->features),
                         SentenceUnless(!is_last || HasAllKeypoints(message.keypoints, request->features),
                                        "its parts do not fit together")});
  }
};
TESSERA_CODEC(RelocalizationRequest);

template <>
struct Codec<RelocalizationAnswer> {
  using Message = relocalization_t;
  static constexpr const char* kTypeName = "relocalization_t";

  template <class Emit>
  static void Cut(const RelocalizationAnswer& answer, Message* message, size_t max_bytes, Emit emit) {
    message->frame = answer.frame.value;
    message->reference = answer.reference.value;
    message->reference_from_camera = ToMessage(answer.reference_from_camera);
    message->num_candidates = answer.num_candidates;
    const size_t overhead = static_cast<size_t>(message->getEncodedSize());
    Dealer seen(answer.seen);
    do {
      size_t room = std::max(max_bytes - std::min(max_bytes, overhead), kBytesPerSeen);
      message->seen.clear();
      seen.Deal(kBytesPerSeen, &room, [&](const SeenLandmark& item) { message->seen.push_back(MessageOf(item)); });
      message->num_seen = static_cast<int32_t>(message->seen.size());
      emit(*message);
    } while (!seen.done());
  }

  static std::string Join(const Message& message, RelocalizationAnswer* answer) {
    if (message.header.part == 0) {
      *answer = {};
      answer->frame.value = message.frame;
      answer->reference.value = message.reference;
      answer->num_candidates = message.num_candidates;
    }
    return FirstProblem(
        {CheckFrame(message.frame),
         SentenceUnless(message.frame == answer->frame.value, "its parts do not fit together"),
         SentenceUnless(message.reference >= -1 && message.num_candidates >= 0, "its reference is out of range"),
         FromMessage(message.reference_from_camera, &answer->reference_from_camera),
         JoinSeen(message.seen, message.num_seen, &answer->seen)});
  }
};
TESSERA_CODEC(RelocalizationAnswer);

}  // namespace tessera
