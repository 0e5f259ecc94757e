#include "runtime/clock.h"

#include <chrono>

namespace tessera {
namespace {

template <class SomeClock>
int64_t MicrosecondsOf() {
  return std::chrono::duration_cast<std::chrono::microseconds>(SomeClock::now().time_since_epoch()).count();
}

}  // namespace

int64_t ComputerClock::NowUs() const { return MicrosecondsOf<std::chrono::steady_clock>(); }
int64_t ComputerClock::WallUs() const { return MicrosecondsOf<std::chrono::system_clock>(); }

}  // namespace tessera
