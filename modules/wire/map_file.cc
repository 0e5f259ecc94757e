#include "wire/map_file.h"

#include <algorithm>
#include <utility>

#include "core/errors.h"
#include "map/map_exchange.h"
#include "messages/topics.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

constexpr const char* kHeaderChannel = "MAP_FILE";
constexpr const char* kPublisher = "map_file";
constexpr size_t kMaxMessageBytes = 60000;
constexpr int32_t kVersion = 1;

// The same map gives the same bytes: no clock in them.
MessageHeader HeaderOf(int64_t sequence) { return {.publisher = kPublisher, .epoch_us = 1, .sequence = sequence}; }

CameraCalibration CameraOf(const MapDelta& snapshot) {
  const bool has_features = !snapshot.new_keyframes.empty() && snapshot.new_keyframes.front().features != nullptr;
  return has_features ? snapshot.new_keyframes.front().features->calibration : CameraCalibration{};
}

[[noreturn]] void Refuse(const std::string& path, const std::string& problem) {
  throw InputError("map file " + path + " " + problem);
}

// The next event; false at the end. A map's user knows nothing of logs, so their reader's words are put otherwise.
bool NextEvent(LogFileReader& file, const std::string& path, LogEvent* event) {
  try {
    return file.Next(event);
  } catch (const InputError&) {
    Refuse(path, "is cut off or damaged: copy it again, or make the map again");
  }
}

LogFileReader OpenMapFile(const std::string& path) {
  try {
    return LogFileReader(path);
  } catch (const InputError&) {
    Refuse(path, "can't be read, or is no map: give the map.tessera of a run, or a file that --save-map wrote");
  }
}

MapFileHeader ReadFileHeader(LogFileReader& file, const std::string& path) {
  LogEvent event;
  if (!NextEvent(file, path, &event) || event.channel != kHeaderChannel)
    Refuse(path, "is no map: it does not begin like one");
  ValueJoiner<MapFileHeader> joiner;
  const auto header = ReadHeader(event.data);
  if (!header) Refuse(path, "was written by another version of Tessera: make the map again with this one");
  const Result<const MapFileHeader*> value = joiner.Add(event.data, *header);
  if (!value) Refuse(path, "is damaged, or holds no keyframes: " + value.error().sentence);
  if (*value == nullptr || (*value)->version != kVersion) {
    Refuse(path, "was written by another version of Tessera: make the map again with this one");
  }
  return **value;
}

// Every page names the snapshot that it belongs to.
bool BelongsTo(const MapSnapshotPage& page, const MapDelta& snapshot) {
  return page.part.number == snapshot.number && page.part.answers == snapshot.answers &&
         page.part.hash == snapshot.hash;
}

// What the hash does not cover: that the file's parts speak of one and the same map.
bool DoesFit(const MapFileHeader& header, const MapDelta& snapshot) {
  const auto is_answered = [&](const MapDelta::NewKeyframe& keyframe) { return keyframe.id <= snapshot.answers; };
  return header.num_keyframes == static_cast<int64_t>(snapshot.new_keyframes.size()) &&
         header.num_landmarks == static_cast<int64_t>(snapshot.changed_landmarks.size()) &&
         header.camera == CameraOf(snapshot) && std::ranges::all_of(snapshot.new_keyframes, is_answered);
}

}  // namespace

void WriteMapFile(const Map& map, const std::string& path) {
  const MapDelta snapshot = map.Snapshot();
  const int32_t num_pages = NumSnapshotPages(snapshot);
  LogFileWriter file(path);
  const MapFileHeader file_header{kVersion, num_pages, map.keyframes().size(), map.landmarks().size(),
                                  CameraOf(snapshot)};
  file.Write(0, kHeaderChannel, EncodeValue(file_header, HeaderOf(0), kMaxMessageBytes).front());
  int64_t sequence = 1;
  for (int32_t page = 0; page < num_pages; ++page) {
    for (const Bytes& message : EncodeValue(CutSnapshotPage(snapshot, page), HeaderOf(sequence), kMaxMessageBytes)) {
      file.Write(sequence++, kMapSnapshot.name, message);
    }
  }
  file.Close();
}

MapDelta ReadMapFile(const std::string& path) {
  LogFileReader file = OpenMapFile(path);
  const MapFileHeader header = ReadFileHeader(file, path);
  ValueJoiner<MapSnapshotPage> joiner;
  MapDelta snapshot;
  int32_t num_pages = 0;
  for (LogEvent event; NextEvent(file, path, &event);) {
    const auto message_header = ReadHeader(event.data);
    if (!message_header) Refuse(path, "is damaged: one of its messages can't be read");
    const Result<const MapSnapshotPage*> value = joiner.Add(event.data, *message_header);
    if (!value) Refuse(path, "is damaged: " + value.error().sentence);
    if (*value == nullptr) continue;
    const MapSnapshotPage& page = **value;
    if (page.page != num_pages || page.num_pages != header.num_pages) Refuse(path, "is damaged: its pages do not fit");
    if (num_pages++ == 0) {
      snapshot = page.part;
    } else if (BelongsTo(page, snapshot)) {
      AppendPage(page, &snapshot);
    } else {
      Refuse(path, "is damaged: its pages do not fit");
    }
  }
  if (num_pages != header.num_pages) Refuse(path, "is cut off: copy it again, or make the map again");
  if (!DoesFit(header, snapshot)) Refuse(path, "is damaged: its beginning speaks of another map");
  return snapshot;
}

}  // namespace tessera
