#include "runtime/lcm_bus.h"

#include <algorithm>
#include <stdexcept>
#include <thread>
#include <utility>

#include "core/errors.h"

namespace tessera {
namespace {

// A receiver is expected to empty its buffer in this time: LCM's own thread does nothing else.
constexpr double kDrainSeconds = 0.002;
constexpr int kMaxQueuedMessages = 1 << 16;  // of one subscription

}  // namespace

LcmBus::LcmBus(const std::string& url, size_t burst_bytes)
    : url_(url), lcm_(lcm_create(url.c_str())), burst_bytes_(burst_bytes), paced_(std::chrono::steady_clock::now()) {
  if (lcm_ == nullptr) {
    throw InputError("LCM refuses the bus URL " + url + ": write it like udpm://239.255.76.67:7667?ttl=0");
  }
}

LcmBus::~LcmBus() { lcm_destroy(lcm_); }

bool LcmBus::Publish(const std::string& channel, ByteView message, std::optional<int64_t> /*source_us*/) {
  Pace(message.size());
  return lcm_publish(lcm_, channel.c_str(), message.data(), static_cast<unsigned>(message.size())) == 0;
}

void LcmBus::Pace(size_t num_bytes) {
  if (burst_bytes_ == 0) return;
  const auto limit = static_cast<double>(burst_bytes_);
  while (true) {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - paced_).count();
    recent_bytes_ = std::max(0.0, recent_bytes_ - seconds * limit / kDrainSeconds);
    paced_ = now;
    if (recent_bytes_ <= limit) break;
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  recent_bytes_ += static_cast<double>(num_bytes);
}

void LcmBus::Subscribe(const void* owner, const std::string& channel, Handler handler) {
  std::unique_ptr<Topic>& topic = topics_[channel];
  if (!topic) {
    topic = std::make_unique<Topic>();
    // Channel names are checked to hold nothing that a regular expression would take for something else.
    lcm_subscription_t* subscription =
        lcm_subscribe(lcm_, channel.empty() ? ".*" : channel.c_str(), &LcmBus::OnMessage, topic.get());
    if (subscription == nullptr) {
      topics_.erase(channel);
      throw std::runtime_error(
          "LCM's self-test on " + url_ +
          " failed: what this host sends to the group does not come back to it; look for a firewall "
          "that drops UDP multicast, or give loopback the route: `sudo ip link set lo multicast on` "
          "and `sudo ip route add 224.0.0.0/4 dev lo`");
    }
    // LCM would drop messages beyond 30. Flow control bounds this queue; the limit is for what strangers send during a
    // long step.
    lcm_subscription_set_queue_capacity(subscription, kMaxQueuedMessages);
    file_descriptor_ = lcm_get_fileno(lcm_);
  }
  topic->subscribers.push_back(std::make_shared<Subscriber>(Subscriber{owner, std::move(handler)}));
}

void LcmBus::Unsubscribe(const void* owner) {
  for (auto& [channel, topic] : topics_) {
    std::erase_if(topic->subscribers, [owner](const auto& subscriber) { return subscriber->owner == owner; });
  }
}

bool LcmBus::HandleOne() { return file_descriptor_ >= 0 && lcm_handle_timeout(lcm_, 0) > 0; }

void LcmBus::OnMessage(const lcm_recv_buf_t* buffer, const char* channel, void* user_data) {
  Topic& topic = *static_cast<Topic*>(user_data);
  const ByteView message(static_cast<const uint8_t*>(buffer->data), buffer->data_size);
  const std::string name = channel;
  // By index: a handler may subscribe.
  for (size_t i = 0; i < topic.subscribers.size(); ++i) {
    const std::shared_ptr<Subscriber> subscriber = topic.subscribers[i];
    subscriber->handler(name, message, buffer->recv_utime);
  }
}

}  // namespace tessera
