// MAP_DELTA, MAP_SNAPSHOT, MAP_REQUEST, REMOVED_KEYFRAMES; and what a map file begins with.
#include <algorithm>

#include "map/map_exchange.h"
#include "map/removed_keyframes.h"
#include "tessera/map_delta_t.hpp"
#include "tessera/map_file_t.hpp"
#include "tessera/map_request_t.hpp"
#include "tessera/map_snapshot_t.hpp"
#include "tessera/removed_keyframes_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_map_change.h"
#include "wire/codec_parts.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

// What a delta and a page of a snapshot have in common.
template <class Message, class Emit>
void CutParts(const MapDelta& delta, Message* message, size_t max_bytes, Emit emit) {
  message->number = delta.number;
  message->answers = delta.answers.value;
  message->hash = static_cast<int64_t>(delta.hash);
  const auto overhead = static_cast<size_t>(message->getEncodedSize());
  ChangeCutter cutter(delta);
  do {
    cutter.Fill(max_bytes - std::min(max_bytes, overhead), &message->change);
    emit(*message);
  } while (!cutter.done());
}

template <class Message>
std::string JoinPart(const Message& message, MapDelta* delta) {
  if (message.header.part == 0) {
    *delta = {};
    delta->number = message.number;
    delta->answers.value = message.answers;
    delta->hash = static_cast<uint64_t>(message.hash);
  }
  if (message.number < 0 || message.answers < -1 || message.number != delta->number) {
    return "its number is out of range, or its parts do not fit together";
  }
  return JoinChange(message.change, message.header.part + 1 == message.header.num_parts, delta);
}

}  // namespace

template <>
struct Codec<MapDelta> {
  using Message = map_delta_t;
  static constexpr const char* kTypeName = "map_delta_t";

  // A snapshot does not travel as one delta, but page by page.
  template <class Emit>
  static void Cut(const MapDelta& delta, Message* message, size_t max_bytes, Emit emit) {
    message->asks_adjustment = delta.asks_adjustment ? 1 : 0;
    CutParts(delta, message, max_bytes, emit);
  }
  static std::string Join(const Message& message, MapDelta* delta) {
    std::string problem = JoinPart(message, delta);
    delta->asks_adjustment = message.asks_adjustment != 0;
    return problem;
  }
};
TESSERA_CODEC(MapDelta);

template <>
struct Codec<MapSnapshotPage> {
  using Message = map_snapshot_t;
  static constexpr const char* kTypeName = "map_snapshot_t";

  template <class Emit>
  static void Cut(const MapSnapshotPage& page, Message* message, size_t max_bytes, Emit emit) {
    message->page = page.page;
    message->num_pages = page.num_pages;
    CutParts(page.part, message, max_bytes, emit);
  }
  static std::string Join(const Message& message, MapSnapshotPage* page) {
    page->page = message.page;
    page->num_pages = message.num_pages;
    const std::string problem = JoinPart(message, &page->part);
    page->part.is_snapshot = true;
    const map_change_t& change = message.change;
    const bool is_plain = change.num_moved_keyframes == 0 && change.num_removed_observations == 0 &&
                          change.num_changed_parents == 0 && change.num_removed_landmarks == 0 &&
                          change.num_removed_keyframes == 0;
    return FirstProblem(
        {SentenceUnless(message.page >= 0 && message.page < message.num_pages, "its page is out of range"),
         SentenceUnless(is_plain, "a snapshot takes nothing back"), problem});
  }
};
TESSERA_CODEC(MapSnapshotPage);

template <>
struct Codec<MapFileHeader> {
  using Message = map_file_t;
  static constexpr const char* kTypeName = "map_file_t";

  template <class Emit>
  static void Cut(const MapFileHeader& header, Message* message, size_t, Emit emit) {
    message->version = header.version;
    message->num_pages = header.num_pages;
    message->num_keyframes = header.num_keyframes;
    message->num_landmarks = header.num_landmarks;
    message->camera = ToMessage(header.camera);
    emit(*message);
  }
  static std::string Join(const Message& message, MapFileHeader* header) {
    *header = {message.version, message.num_pages, message.num_keyframes, message.num_landmarks, {}};
    return FirstProblem(
        {SentenceUnless(message.num_pages >= 1 && message.num_keyframes >= 0 && message.num_landmarks >= 0,
                        "one of its counts is out of range"),
         FromMessage(message.camera, &header->camera)});
  }
};
TESSERA_CODEC(MapFileHeader);

template <>
struct Codec<MapRequest> {
  using Message = map_request_t;
  static constexpr const char* kTypeName = "map_request_t";

  template <class Emit>
  static void Cut(const MapRequest& request, Message* message, size_t, Emit emit) {
    message->next_delta = request.next_delta;
    message->snapshot = request.snapshot;
    message->page = request.page;
    emit(*message);
  }
  static std::string Join(const Message& message, MapRequest* request) {
    *request = {.next_delta = message.next_delta, .snapshot = message.snapshot, .page = message.page};
    return SentenceUnless(message.next_delta >= -1 && message.snapshot >= -1 && message.page >= 0,
                          "one of its numbers is out of range");
  }
};
TESSERA_CODEC(MapRequest);

template <>
struct Codec<RemovedInDelta> {
  using Message = removed_keyframes_t;
  static constexpr const char* kTypeName = "removed_keyframes_t";
  static constexpr size_t kBytesPerTie = 80;

  template <class Emit>
  static void Cut(const RemovedInDelta& removed, Message* message, size_t max_bytes, Emit emit) {
    message->delta = removed.delta;
    message->num_ties = 0;
    const auto overhead = static_cast<size_t>(message->getEncodedSize());
    const size_t per_part = std::max<size_t>(1, (max_bytes - std::min(max_bytes, overhead)) / kBytesPerTie);
    size_t next = 0;
    do {
      message->ties.clear();
      for (; next < removed.links.size() && message->ties.size() < per_part; ++next) {
        keyframe_tie_t& link = message->ties.emplace_back();
        link.keyframe = removed.links[next].keyframe.value;
        link.parent = removed.links[next].parent.value;
        link.parent_from_keyframe = ToMessage(removed.links[next].parent_from_keyframe);
      }
      message->num_ties = static_cast<int32_t>(message->ties.size());
      emit(*message);
    } while (next < removed.links.size());
  }
  static std::string Join(const Message& message, RemovedInDelta* removed) {
    if (message.header.part == 0) *removed = {message.delta, {}};
    std::string problem =
        SentenceUnless(message.delta >= 0 && message.delta == removed->delta, "its delta is out of range");
    for (size_t i = 0; problem.empty() && i < static_cast<size_t>(message.num_ties); ++i) {
      KeyframeLink& link = removed->links.emplace_back();
      link.keyframe.value = message.ties[i].keyframe;
      link.parent.value = message.ties[i].parent;
      problem = FirstProblem({SentenceUnless(tie.parent.valid() && tie.keyframe.valid(), "a keyframe is out of range"),
                              FromMessage(message.ties[i].parent_from_keyframe, &link.parent_from_keyframe)});
    }
    return problem;
  }
};
TESSERA_CODEC(RemovedInDelta);

}  // namespace tessera
