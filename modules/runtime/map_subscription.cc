#include "runtime/map_subscription.h"

#include <chrono>
#include <memory>
#include <utility>

#include "core/errors.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

// The owner may be in the middle of a bundle adjustment, and an answer is some messages: asking more often helps
// nobody.
constexpr std::chrono::milliseconds kAskAgain{300};

}  // namespace

MapSubscription::MapSubscription(StageContext& context, bool joins_late, Apply apply, std::function<void()> on_news)
    : context_(context), apply_(std::move(apply)), on_news_(std::move(on_news)), follower_(joins_late) {
  requests_ = context.Advertise(kMapRequest);
  context.Subscribe(kMapDelta, [this](MapDelta delta) {
    follower_.Receive(std::make_shared<const MapDelta>(std::move(delta)));
    ApplyAll();
  });
  context.Subscribe(kMapSnapshot, [this](const MapSnapshotPage& page) {
    follower_.Receive(page);
    TakeRestFromFile();
    ApplyAll();
  });
  context.Every(kAskAgain, [this] {
    follower_.ForgetRequest();
    Ask();
  });
}

// nullopt: the mapper begins without a map, or this node can't read its file: the mapper tells of it.
std::optional<MapDelta> MapSubscription::ReadLoadedMap() const {
  const std::string path = context_.settings().Get<MapperSettings>().load_map;
  if (path.empty()) return std::nullopt;
  try {
    return ReadMapFile(path);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

void MapSubscription::ReadAhead() { read_ahead_ = ReadLoadedMap(); }

// A map of hundreds of megabytes comes sooner from the file that the mapper began with, where this node has it, than by
// the bus. Another map's file has another hash.
void MapSubscription::TakeRestFromFile() {
  const MapDelta* begun = follower_.BegunSnapshot();
  if (begun == nullptr) return;
  std::optional<MapDelta> whole = read_ahead_ ? std::exchange(read_ahead_, std::nullopt) : ReadLoadedMap();
  if (whole && whole->number == begun->number && whole->hash == begun->hash) follower_.ReceiveRest(std::move(*whole));
}

void MapSubscription::FollowToEnd() {
  context_.Subscribe(kEndOfStream, [this](const EndOfStream& end) { Receive(end); });
}

void MapSubscription::Receive(const EndOfStream& end) {
  if (end.stage != StageKind::kMapper) return;
  mapper_end_ = end;
  follower_.Expect(end.num_values);
  on_news_();
}

void MapSubscription::ApplyAll() {
  for (const MapFollower::Delta& delta : follower_.Take()) {
    if (const Result<> applied = apply_(delta); !applied) {
      Reject(applied.error().sentence);
      break;
    }
  }
  on_news_();
  Ask();
}

void MapSubscription::Reject(const std::string& reason) {
  follower_.Reject();
  context_.SetValue("map_rejected", static_cast<double>(++num_rejected_));
  context_.ReportError("the map can't be followed, and is asked for anew: " + reason);
}

void MapSubscription::Ask() {
  if (const std::optional<MapRequest> request = follower_.TakeRequest()) requests_.Publish(*request);
}

}  // namespace tessera
