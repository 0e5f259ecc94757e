#include "runtime/map_subscription.h"

#include <chrono>
#include <memory>
#include <utility>

namespace tessera {
namespace {

// The owner may be in the middle of a bundle adjustment, and an answer is some messages: asking more often helps
// nobody.
constexpr std::chrono::milliseconds kAskAgain{300};

}  // namespace

MapSubscription::MapSubscription(StageContext& context, bool joins_late, std::function<void()> on_deltas)
    : context_(context), on_deltas_(std::move(on_deltas)), follower_(joins_late) {
  requests_ = context.Advertise(kMapRequest);
  context.Subscribe(kMapDelta, [this](const MapDelta& delta) {
    follower_.Receive(std::make_shared<const MapDelta>(delta));
    on_deltas_();
    Ask();
  });
  context.Subscribe(kMapSnapshot, [this](const MapSnapshotPage& page) {
    follower_.Receive(page);
    on_deltas_();
    Ask();
  });
  context.Every(kAskAgain, [this] {
    asked_.reset();
    Ask();
  });
}

void MapSubscription::Reject(const std::string& sentence) {
  follower_.Reject();
  context_.SetValue("map_rejected", static_cast<double>(++num_rejected_));
  context_.ReportError("the map can't be followed, and is asked for anew: " + sentence);
}

// Each request once, until the next one or the timer: an answer is on its way.
void MapSubscription::Ask() {
  const std::optional<MapRequest> request = follower_.Request();
  if (request && request != asked_) requests_.Publish(*request);
  asked_ = request;
}

}  // namespace tessera
