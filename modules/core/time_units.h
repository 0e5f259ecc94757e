// Times on the bus and in files are whole microseconds; equations are in seconds.
#pragma once

#include <cstdint>

namespace tessera {

constexpr double SecondsOf(int64_t us) { return 1e-6 * static_cast<double>(us); }

}  // namespace tessera
