#include "runtime/map_subscription.h"

#include <chrono>
#include <memory>
#include <utility>

#include "map/map_archive.h"

namespace tessera {
namespace {

// The owner may be in the middle of a bundle adjustment, and an answer is some messages: asking more often helps
// nobody.
constexpr std::chrono::milliseconds kAskAgain{300};

// Whether the answer to `asked` brings what `request` asks for. It may be several deltas, of which some have come.
bool IsOnTheWay(const MapRequest& asked, const MapRequest& request) {
  if (asked == request) return true;
  const bool ask_for_deltas = asked.next_delta >= 0 && asked.snapshot < 0 && request.snapshot < 0;
  return ask_for_deltas && request.next_delta > asked.next_delta &&
         request.next_delta < asked.next_delta + static_cast<int64_t>(MapArchive::kMaxDeltas);
}

}  // namespace

MapSubscription::MapSubscription(StageContext& context, bool joins_late, Apply apply, std::function<void()> on_news)
    : context_(context), apply_(std::move(apply)), on_news_(std::move(on_news)), follower_(joins_late) {
  requests_ = context.Advertise(kMapRequest);
  context.Subscribe(kMapDelta, [this](const MapDelta& delta) {
    follower_.Receive(std::make_shared<const MapDelta>(delta));
    ApplyAll();
  });
  context.Subscribe(kMapSnapshot, [this](const MapSnapshotPage& page) {
    follower_.Receive(page);
    ApplyAll();
  });
  context.Every(kAskAgain, [this] {
    asked_.reset();
    Ask();
  });
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

// Each request once, until the timer.
void MapSubscription::Ask() {
  const std::optional<MapRequest> request = follower_.Request();
  if (request && asked_ && IsOnTheWay(*asked_, *request)) return;
  if (request) requests_.Publish(*request);
  asked_ = request;
}

}  // namespace tessera
