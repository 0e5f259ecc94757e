#include "wire/log.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "messages/topics.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

// Where a message of a stream lies in the log.
struct Place {
  int64_t sequence = 0;
  int64_t position = 0;  // bytes from the front
  int32_t part = 0;
  int32_t num_parts = 1;
};

// One camera's messages on one channel, in order of their numbers.
struct RecordedStream {
  std::vector<Place> places;
  size_t next = 0;

  bool done() const { return next >= places.size(); }
  int64_t position() const { return places[next].position; }
};

using StreamName = std::pair<std::string, int64_t>;  // publisher and its start

std::array<const Channel*, 5> CameraChannels() {
  return {&kCalibration, &kGroundTruth, &kCamera, &kEndOfStream, &kColor};
}

// By number, each once, and only of values of which every part is there.
std::vector<Place> WholeValues(std::vector<Place> places) {
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.sequence < b.sequence; });
  const auto same = [](const Place& a, const Place& b) { return a.sequence == b.sequence; };
  places.erase(std::unique(places.begin(), places.end(), same), places.end());
  std::vector<Place> whole;
  for (size_t first = 0; first < places.size();) {
    size_t end = first;
    while (end < places.size() && places[end].part == static_cast<int32_t>(end - first) &&
           places[end].sequence == places[first].sequence + static_cast<int64_t>(end - first) &&
           places[end].num_parts == places[first].num_parts &&
           static_cast<int32_t>(end - first) < places[first].num_parts) {
      ++end;
    }
    if (static_cast<int32_t>(end - first) == places[first].num_parts) {
      whole.insert(whole.end(), places.begin() + static_cast<ptrdiff_t>(first),
                   places.begin() + static_cast<ptrdiff_t>(end));
    }
    first = std::max(end, first + 1);
  }
  return whole;
}

}  // namespace

struct LogReader::Impl {
  Impl(const std::string& log_path, const std::string& prefix);
  void Index(const std::string& prefix);
  int64_t NumFramesSent();
  FrameId IdOfFrame(size_t first_place);
  template <class Value>
  std::optional<Value> Join(ValueJoiner<Value>& joiner, const LogEvent& event, const MessageHeader& header);
  std::pair<LogEvent, MessageHeader> NextOf(RecordedStream& stream);
  std::optional<LoggedValue> Take(size_t channel);
  void ReadColor();

  std::string path;
  LogFileReader file;
  std::array<RecordedStream, 4> streams;  // in the order of CameraChannels()
  RecordedStream colors;                  // the last of them
  int64_t num_frames = 0;
  int64_t num_frames_sent = 0;
  ValueJoiner<CameraCalibration> calibrations;
  ValueJoiner<GroundTruthPose> truths;
  ValueJoiner<CameraFrame> frames;
  ValueJoiner<EndOfStream> ends;
  ValueJoiner<ColorFrame> color_joiner;
  std::optional<ColorFrame> color;  // the last one read
};

LogReader::Impl::Impl(const std::string& log_path, const std::string& prefix) : path(log_path), file(log_path) {
  Index(prefix);
}

// Finds the messages of the one camera that the log must hold.
void LogReader::Impl::Index(const std::string& prefix) {
  std::array<std::map<StreamName, std::vector<Place>>, 5> found;
  LogEvent event;
  for (int64_t position = file.position(); file.Next(&event); position = file.position()) {
    for (size_t i = 0; i < found.size(); ++i) {
      if (event.channel != prefix + CameraChannels()[i]->name) continue;
      if (const auto header = ReadHeader(event.data)) {
        found[i][{header->publisher, header->epoch_us}].push_back(
            {header->sequence, position, header->part, header->num_parts});
      }
    }
  }
  const auto& cameras = found[2];
  if (cameras.empty()) {
    throw InputError("log " + path + " has no CAMERA messages: record the source with `procman/tessera record`");
  }
  if (cameras.size() > 1) {
    throw InputError("log " + path + " holds " + std::to_string(cameras.size()) +
                     " recordings of a camera: record each into a log of its own");
  }
  const StreamName camera = cameras.begin()->first;
  for (size_t i = 0; i < streams.size(); ++i) streams[i].places = WholeValues(std::move(found[i][camera]));
  colors.places = WholeValues(std::move(found.back()[camera]));
  num_frames = std::count_if(streams[2].places.begin(), streams[2].places.end(),
                             [](const Place& place) { return place.part == 0; });
  if (num_frames == 0) {
    throw InputError(
        "log " + path +
        " has no whole frame: it was recorded with losses; record the source with `procman/tessera record`");
  }
  num_frames_sent = NumFramesSent();
}

// As the camera counted them at its end, or else from the first whole frame to the last.
int64_t LogReader::Impl::NumFramesSent() {
  LogEvent event;
  for (const Place& place : streams[3].places) {
    file.Seek(place.position);
    file.Next(&event);
    ValueJoiner<EndOfStream> joiner;
    const auto header = ReadHeader(event.data);
    const Result<const EndOfStream*> end = joiner.Add(event.data, *header);
    // A camera begins with any frame of its source (num_values: see EndOfStream).
    if (end && *end != nullptr) return std::max(num_frames, (*end)->num_frames - (*end)->num_values);
  }
  const std::vector<Place>& places = streams[2].places;
  const auto last = std::find_if(places.rbegin(), places.rend(), [](const Place& place) { return place.part == 0; });
  const size_t first_of_last = places.size() - 1 - static_cast<size_t>(last - places.rbegin());
  return std::max(num_frames, IdOfFrame(first_of_last).value - IdOfFrame(0).value + 1);
}

// Of the whole frame whose first message is that one.
FrameId LogReader::Impl::IdOfFrame(size_t first_place) {
  ValueJoiner<CameraFrame> joiner;
  LogEvent event;
  for (size_t i = first_place; i < streams[2].places.size(); ++i) {
    file.Seek(streams[2].places[i].position);
    file.Next(&event);
    const auto header = ReadHeader(event.data);
    if (const auto frame = Join(joiner, event, *header)) return frame->id;
  }
  return {};
}

template <class Value>
std::optional<Value> LogReader::Impl::Join(ValueJoiner<Value>& joiner, const LogEvent& event,
                                           const MessageHeader& header) {
  const Result<const Value*> value = joiner.Add(event.data, header);
  if (!value) {
    throw InputError("log " + path + " holds a damaged message on " + event.channel + ": " + value.error().sentence);
  }
  return *value == nullptr ? std::nullopt : std::optional<Value>(**value);
}

// The next message of the stream, and its header.
std::pair<LogEvent, MessageHeader> LogReader::Impl::NextOf(RecordedStream& stream) {
  file.Seek(stream.position());
  ++stream.next;
  LogEvent event;
  file.Next(&event);
  const auto header = ReadHeader(event.data);
  if (!header) {
    throw InputError("log " + path + " changed while it was read");
  }
  return {std::move(event), *header};
}

// The value that the next message of the channel completes, if it does.
std::optional<LoggedValue> LogReader::Impl::Take(size_t channel) {
  const auto [event, header] = NextOf(streams[channel]);
  switch (channel) {
    case 0:
      return Join(calibrations, event, header);
    case 1:
      return Join(truths, event, header);
    case 2:
      return Join(frames, event, header);
    default:
      return Join(ends, event, header);
  }
}

// Sets `color` if the next message of COLOR completes one.
void LogReader::Impl::ReadColor() {
  const auto [event, header] = NextOf(colors);
  if (auto value = Join(color_joiner, event, header)) color = std::move(*value);
}

LogReader::LogReader(const std::string& path, const std::string& channel_prefix)
    : impl_(std::make_unique<Impl>(path, channel_prefix)) {}

LogReader::~LogReader() = default;

std::optional<LoggedValue> LogReader::Next() {
  while (true) {
    size_t earliest = impl_->streams.size();
    for (size_t i = 0; i < impl_->streams.size(); ++i) {
      if (!impl_->streams[i].done() &&
          (earliest == impl_->streams.size() || impl_->streams[i].position() < impl_->streams[earliest].position())) {
        earliest = i;
      }
    }
    if (earliest == impl_->streams.size()) {
      return std::nullopt;
    }
    if (auto value = impl_->Take(earliest)) {
      return value;
    }
  }
}

bool LogReader::has_colors() const { return !impl_->colors.places.empty(); }

ColorImage LogReader::ColorOf(FrameId frame) {
  std::optional<ColorFrame>& color = impl_->color;
  while (!color || color->id < frame) {
    if (impl_->colors.done()) return {};
    impl_->ReadColor();
  }
  return color->id == frame ? std::exchange(color, std::nullopt)->image : ColorImage();
}

int64_t LogReader::num_frames() const { return impl_->num_frames; }

std::string LogReader::loss() const {
  if (impl_->num_frames == impl_->num_frames_sent) return "";
  return "log " + impl_->path + " lacks messages: " + std::to_string(impl_->num_frames) + " of " +
         std::to_string(impl_->num_frames_sent) + " frames are whole, and the others are left out";
}

}  // namespace tessera
