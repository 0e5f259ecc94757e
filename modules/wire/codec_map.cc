// MAP_DELTA, MAP_SNAPSHOT, MAP_REQUEST, REMOVED_KEYFRAMES; and what a map file begins with.
#include "map/map_exchange.h"
#include "map/removed_keyframes.h"
#include "messages/mapper_step.h"
#include "tessera/map_delta_t.hpp"
#include "tessera/map_file_t.hpp"
#include "tessera/map_request_t.hpp"
#include "tessera/map_snapshot_t.hpp"
#include "tessera/mapper_step_t.hpp"
#include "tessera/removed_keyframes_t.hpp"
#include "wire/codec_impl.h"
#include "wire/keypoints_layout.h"
#include "wire/map_file.h"

namespace tessera {

template <>
struct Layout<map_keyframe_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& keyframe) {
    fields.Key(message.keyframe, keyframe.id);
    fields(message.parent, keyframe.parent);
    fields(message.world_from_camera, keyframe.world_from_camera);
    fields(message.scale, keyframe.scale);
    fields.Check(keyframe.id.valid(), "a keyframe's number is negative");
    fields.Check(IsScale(keyframe.scale), "a keyframe's scale is out of range");
    fields(message.keypoints, fields.Target(keyframe.features));
  }
};

template <>
struct Layout<map_landmark_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& changed) {
    auto& landmark = changed.landmark;
    fields(message.landmark, changed.id);
    fields(message.position_in_world, landmark.position_in_world);
    fields(message.normal, landmark.normal);
    fields(message.depth_sigma, landmark.depth_sigma);
    fields(message.min_distance, landmark.min_distance);
    fields(message.max_distance, landmark.max_distance);
    fields(message.descriptor, landmark.descriptor);
    fields.Check(changed.id.valid(), "a landmark's number is negative");
    fields.Check(landmark.depth_sigma >= 0.0, "a landmark's depth sigma is negative");
  }
};

template <>
struct Layout<map_observation_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& changed) {
    auto& observation = changed.observation;
    fields(message.landmark, changed.landmark);
    fields(message.keyframe, observation.keyframe);
    fields.Count(message.keypoint, observation.keypoint);
    fields.Check(changed.landmark.valid() && observation.keyframe.valid(), "an observation has a negative number");
  }
};

template <>
struct Layout<closed_loop_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& loop) {
    fields(message.current, loop.current);
    fields(message.matched, loop.matched);
    fields(message.scale, loop.scale);
    fields.Count(message.num_points, loop.num_points);
    fields.Check(loop.current.valid() && loop.matched.valid(), "a closed loop's keyframe has a negative number");
    fields.Check(IsScale(loop.scale), "a closed loop's scale is out of range");
  }
};

template <>
struct Layout<map_change_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& delta) {
    using Moved = MapDelta::MovedKeyframe;
    using Parent = MapDelta::ChangedParent;
    fields(message.fx, delta.lens.fx_px);
    fields(message.fy, delta.lens.fy_px);
    fields.Check((delta.lens.fx_px > 0.0) == (delta.lens.fy_px > 0.0) && delta.lens.fx_px >= 0.0,
                 "its focal lengths are out of range");
    fields(message.radial, delta.lens.radial);
    fields.Check(IsRadial(delta.lens.radial), "its radial distortion is out of range");
    DescribeRightShift(fields, message, delta.lens.right_shift);
    fields.CutList(message.num_new_keyframes, message.new_keyframes, delta.new_keyframes);
    auto& moved = delta.moved_keyframes;
    fields.Table(
        message.num_moved_keyframes, [&](size_t i) { return moved[i].id.valid() && IsScale(moved[i].scale); },
        Column(message.moved_keyframes, moved, &Moved::id),
        Column(message.world_from_camera, moved, &Moved::world_from_camera),
        Column(message.scale, moved, &Moved::scale));
    fields.List(message.num_landmarks, message.landmarks, delta.changed_landmarks);
    fields.List(message.num_removed_observations, message.removed_observations, delta.removed_observations);
    fields.List(message.num_new_observations, message.new_observations, delta.new_observations);
    auto& parents = delta.changed_parents;
    fields.Table(
        message.num_changed_parents, [&](size_t i) { return parents[i].id.valid(); },
        Column(message.children, parents, &Parent::id), Column(message.parents, parents, &Parent::parent));
    fields.List(message.num_removed_landmarks, message.removed_landmarks, delta.removed_landmarks);
    fields.List(message.num_removed_keyframes, message.removed_keyframes, delta.removed_keyframes);
    fields.List(message.num_closed_loops, message.closed_loops, delta.closed_loops);
  }
};

// A snapshot does not travel as one delta, but page by page.
template <>
struct Layout<map_delta_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& delta) {
    fields.Key(message.number, delta.number);
    fields(message.answers, delta.answers);
    fields.Bits(message.hash, delta.hash);
    fields(message.asks_adjustment, delta.asks_adjustment);
    fields.Check(delta.number >= 0, "its number is negative");
    fields(message.change, delta);
  }
};
TESSERA_CODEC(MapDelta, map_delta_t);

template <>
struct Layout<map_snapshot_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& page) {
    auto& part = page.part;
    fields.Key(message.number, part.number);
    fields(message.answers, part.answers);
    fields.Bits(message.hash, part.hash);
    fields.Key(message.page, page.page);
    fields(message.num_pages, page.num_pages);
    fields.Check(part.number >= 0, "its number is negative");
    fields.Check(page.page >= 0 && page.page < page.num_pages, "its page is out of range");
    fields.Implied(part.is_snapshot, true);
    fields(message.change, part);
    fields.Check(part.moved_keyframes.empty() && part.removed_observations.empty() && part.changed_parents.empty() &&
                     part.removed_landmarks.empty() && part.removed_keyframes.empty(),
                 "a snapshot takes nothing back");
  }
};
TESSERA_CODEC(MapSnapshotPage, map_snapshot_t);

template <>
struct Layout<map_file_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& header) {
    fields(message.version, header.version);
    fields.Count(message.num_pages, header.num_pages);
    fields.Count(message.num_keyframes, header.num_keyframes);
    fields.Count(message.num_landmarks, header.num_landmarks);
    fields(message.camera, header.camera);
    fields.Check(header.num_pages >= 1, "it has no pages");
  }
};
TESSERA_CODEC(MapFileHeader, map_file_t);

template <>
struct Layout<map_request_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& request) {
    fields(message.next_delta, request.next_delta);
    fields(message.snapshot, request.snapshot);
    fields.Count(message.page, request.page);
    fields.Check(request.next_delta >= -1 && request.snapshot >= -1, "one of its numbers is out of range");
  }
};
TESSERA_CODEC(MapRequest, map_request_t);

template <>
struct Layout<keyframe_tie_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& link) {
    fields(message.keyframe, link.keyframe);
    fields(message.parent, link.parent);
    fields(message.parent_from_keyframe, link.parent_from_keyframe);
    fields.Check(link.keyframe.valid() && link.parent.valid(), "a keyframe's number is negative");
  }
};

template <>
struct Layout<removed_keyframes_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& removed) {
    fields.Key(message.delta, removed.delta);
    fields.Check(removed.delta >= 0, "its delta's number is negative");
    fields.List(message.num_ties, message.ties, removed.links);
  }
};
TESSERA_CODEC(RemovedInDelta, removed_keyframes_t);

template <>
struct Layout<mapper_step_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& step) {
    fields(message.is_repeatable, step.is_repeatable);
    Layout<map_delta_t>::Describe(fields, message, step.delta);  // its fields have the same names
    fields.List(message.num_ties, message.ties, step.removed);
    fields(message.first_recent, step.first_recent);
    fields(message.end_landmark, step.end_landmark);
  }
};
TESSERA_CODEC(MapperStep, mapper_step_t);

}  // namespace tessera
