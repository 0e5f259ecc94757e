#include "runtime/udp_check.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>

namespace tessera {
namespace {

class UdpSocket {
 public:
  UdpSocket() : descriptor_(socket(AF_INET, SOCK_DGRAM, 0)) {}
  ~UdpSocket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;
  int descriptor() const { return descriptor_; }

  template <class Value>
  bool Set(int level, int option, const Value& value) {
    return setsockopt(descriptor_, level, option, &value, sizeof(value)) == 0;
  }

 private:
  int descriptor_;
};

sockaddr_in SocketAddress(const UdpAddress& address) {
  sockaddr_in socket_address{};
  socket_address.sin_family = AF_INET;
  socket_address.sin_port = htons(static_cast<uint16_t>(address.port));
  inet_pton(AF_INET, address.group.c_str(), &socket_address.sin_addr);
  return socket_address;
}

}  // namespace

std::optional<UdpAddress> ParseUdpUrl(const std::string& url) {
  const std::string scheme = "udpm://";
  if (!url.starts_with(scheme)) return std::nullopt;
  const std::string network = url.substr(scheme.size(), url.find('?') - scheme.size());
  const size_t colon = network.find(':');
  if (colon == std::string::npos) return std::nullopt;
  UdpAddress address{.group = network.substr(0, colon)};
  const char* end = network.data() + network.size();
  const auto [parsed, error] = std::from_chars(network.data() + colon + 1, end, address.port);
  in_addr group{};
  const bool is_valid = error == std::errc() && parsed == end && address.port > 0 && address.port <= 65535 &&
                        inet_pton(AF_INET, address.group.c_str(), &group) == 1 && IN_MULTICAST(ntohl(group.s_addr));
  return is_valid ? std::optional(address) : std::nullopt;
}

int GrantedReceiveBuffer(int asked_bytes) {
  UdpSocket udp;
  udp.Set(SOL_SOCKET, SO_RCVBUF, asked_bytes);
  int granted = 0;
  socklen_t size = sizeof(granted);
  getsockopt(udp.descriptor(), SOL_SOCKET, SO_RCVBUF, &granted, &size);
  return granted / 2;  // the kernel reports double, for its own bookkeeping
}

Result<> CheckUdp(const UdpAddress& address) {
  const std::string place = "UDP multicast group " + address.group + ", port " + std::to_string(address.port);
  const sockaddr_in socket_address = SocketAddress(address);
  UdpSocket udp;
  if (!udp.Set(SOL_SOCKET, SO_REUSEADDR, 1) ||
      bind(udp.descriptor(), reinterpret_cast<const sockaddr*>(&socket_address), sizeof(socket_address)) != 0) {
    return Failed(place + " can't be used (" + std::strerror(errno) +
                  "): another program holds the port; end it, or set other ports in bus.*_url");
  }
  const ip_mreq group{.imr_multiaddr = socket_address.sin_addr, .imr_interface = {.s_addr = htonl(INADDR_ANY)}};
  if (!udp.Set(IPPROTO_IP, IP_ADD_MEMBERSHIP, group) ||
      connect(udp.descriptor(), reinterpret_cast<const sockaddr*>(&socket_address), sizeof(socket_address)) != 0) {
    return Failed(
        "no multicast route to " + place + " (" + std::strerror(errno) +
        "): give loopback one with `sudo ip link set lo multicast on` and `sudo ip route add 224.0.0.0/4 dev lo`");
  }
  return {};
}

}  // namespace tessera
