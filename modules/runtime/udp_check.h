// Checks the network before LCM uses it, since LCM says little about what is missing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/result.h"

namespace tessera {

struct UdpAddress {
  std::string group;  // 239.255.76.67
  int port = 0;
};

// The address in "udpm://GROUP:PORT?..."; nullopt if it is none.
std::optional<UdpAddress> ParseUdpUrl(const std::string& url);

// The receive buffer that the kernel grants to a socket that asks for so many bytes.
int GrantedReceiveBuffer(int asked_bytes);

// Whether the group can be joined and the port be shared; if not, why, and what to do.
Result<> CheckUdp(const UdpAddress& address);

}  // namespace tessera
