#include "runtime/bus.h"

#include <algorithm>
#include <stdexcept>

#include "core/errors.h"
#include "runtime/file_bus.h"
#include "runtime/lcm_bus.h"
#include "runtime/udp_check.h"

namespace tessera {
namespace {

std::shared_ptr<Bus> OpenFile(const std::string& url) {
  const std::string path = url.substr(std::string("file://").size());
  const size_t options = path.find('?');
  if (options == std::string::npos || path.substr(options) != "?mode=w") {
    throw InputError(
        "bus URL " + url +
        " names a log to be read: write file://PATH?mode=w to record one, or camera.source=log:PATH to play one");
  }
  return std::make_shared<FileBus>(path.substr(0, options));
}

std::shared_ptr<Bus> OpenUdp(const std::string& url, int receive_buffer_bytes) {
  const auto address = ParseUdpUrl(url);
  if (!address) {
    throw InputError("bus URL " + url +
                     " has no multicast group and port: write it like udpm://239.255.76.67:7667?ttl=0");
  }
  if (const Result<> usable = CheckUdp(*address); !usable) throw std::runtime_error(usable.error().sentence);
  // No more than the kernel grants: LCM would print a paragraph about the rest for each bus.
  const int granted = std::min(GrantedReceiveBuffer(receive_buffer_bytes), receive_buffer_bytes);
  const std::string asked = "recv_buf_size=" + std::to_string(granted);
  return std::make_shared<LcmBus>(url + (url.find('?') == std::string::npos ? "?" : "&") + asked,
                                  static_cast<size_t>(std::max(granted / 2, 1)));
}

// Replaces `mark` where it occurs.
void Fill(std::string& url, const std::string& mark, int number) {
  if (const size_t at = url.find(mark); at != std::string::npos) url.replace(at, mark.size(), std::to_string(number));
}

}  // namespace

std::shared_ptr<Bus> OpenBus(const std::string& url, int receive_buffer_bytes) {
  if (url.starts_with("file://")) return OpenFile(url);
  if (url.starts_with("udpm://")) return OpenUdp(url, receive_buffer_bytes);
  throw InputError("bus URL " + url + " is not known: write it like udpm://239.255.76.67:7667?ttl=0");
}

std::string UrlOf(const Channel& channel, const Settings& settings) {
  const auto bus = settings.Get<BusSettings>();
  switch (channel.bus) {
    case BusKind::kMain:
      return bus.main_url;
    case BusKind::kCamera:
      return bus.camera_url;
    case BusKind::kColor:
      return bus.color_url.empty() ? bus.camera_url : bus.color_url;
    case BusKind::kWork:
      return bus.work_url;
    case BusKind::kMap:
      return bus.map_url.empty() ? bus.main_url : bus.map_url;
    case BusKind::kTile:
      break;
  }
  std::string url = bus.tile_url;
  const int port = bus.first_tile_port + channel.extractor;
  if (channel.extractor < 0 || channel.extractor >= kMaxExtractors) {
    throw std::invalid_argument("extractor " + std::to_string(channel.extractor) + " has no bus: ids are 0 to " +
                                std::to_string(kMaxExtractors - 1));
  }
  Fill(url, "{port}", port);
  Fill(url, "{id}", channel.extractor);
  return url;
}

}  // namespace tessera
