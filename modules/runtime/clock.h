// Time as the runtime sees it: the computer's, or that of a test.
#pragma once

#include <cstdint>

namespace tessera {

class Clock {
 public:
  virtual ~Clock() = default;
  virtual int64_t NowUs() const = 0;   // never jumps; for time-outs
  virtual int64_t WallUs() const = 0;  // since 1970; for measuring and for people
};

class ComputerClock : public Clock {
 public:
  int64_t NowUs() const override;
  int64_t WallUs() const override;
};

}  // namespace tessera
