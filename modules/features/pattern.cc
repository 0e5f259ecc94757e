#include "features/pattern.h"

#include <cstdlib>

#include "features/tile_plan.h"

namespace tessera {
namespace {

// round(2^14 sin(k / 64 turn)), k = 0 .. 16
constexpr std::array<int, 17> kSine = {0,     1606,  3196,  4756,  6270,  7723,  9102,  10394, 11585,
                                       12665, 13623, 14449, 15137, 15679, 16069, 16305, 16384};

int Sine(int turn) {
  const int t = turn % kNumTurns;
  const int quarter = t % 16;
  switch (t / 16) {
    case 0:
      return kSine[static_cast<size_t>(quarter)];
    case 1:
      return kSine[static_cast<size_t>(16 - quarter)];
    case 2:
      return -kSine[static_cast<size_t>(quarter)];
    default:
      return -kSine[static_cast<size_t>(16 - quarter)];
  }
}
int Cosine(int turn) { return Sine(turn + 16); }

// value / 2^14, rounded to nearest.
int RoundQ14(int value) { return (value + (1 << 13)) >> 14; }

// The point turned by turn / 64 of a full turn; the norm of points is such that it stays within the patch.
uint16_t TurnedOffset(int x, int y, int turn) {
  const int turned_x = RoundQ14(Cosine(turn) * x - Sine(turn) * y);
  const int turned_y = RoundQ14(Sine(turn) * x + Cosine(turn) * y);
  return static_cast<uint16_t>((turned_y + kPatchRadiusPx) * kPatternStride + turned_x + kPatchRadiusPx);
}

TurnedPattern MakeTurnedPattern() {
  TurnedPattern pattern{};
  for (int turn = 0; turn < kNumTurns; ++turn) {
    auto& offsets = pattern.offsets[static_cast<size_t>(turn)];
    size_t i = 0;
    for (const PointPair& pair : UprightPattern()) {
      offsets[i++] = TurnedOffset(pair.x1, pair.y1, turn);
      offsets[i++] = TurnedOffset(pair.x2, pair.y2, turn);
    }
  }
  return pattern;
}

// Generator of Lehmer (minimal standard): the same numbers everywhere.
class Lehmer {
 public:
  int Next(int bound) {
    state_ = state_ * 48271 % 2147483647;
    return static_cast<int>(state_ % bound);
  }

 private:
  int64_t state_ = 20;
};

// A point about the keypoint: sum of uniform numbers (close to normal, sigma about 6 px), within 15 px.
void DrawPoint(Lehmer& random, int8_t& x, int8_t& y) {
  do {
    int sums[2] = {0, 0};
    for (int& sum : sums) {
      for (int i = 0; i < 4; ++i) sum += random.Next(11) - 5;
    }
    x = static_cast<int8_t>(sums[0]);
    y = static_cast<int8_t>(sums[1]);
  } while (x * x + y * y > kPatchRadiusPx * kPatchRadiusPx);
}

std::array<PointPair, 256> MakeUprightPattern() {
  std::array<PointPair, 256> pattern{};
  Lehmer random;
  for (PointPair& pair : pattern) {
    do {
      DrawPoint(random, pair.x1, pair.y1);
      DrawPoint(random, pair.x2, pair.y2);
    } while (std::abs(pair.x1 - pair.x2) + std::abs(pair.y1 - pair.y2) < 3);
  }
  return pattern;
}

}  // namespace

const std::array<PointPair, 256>& UprightPattern() {
  static const std::array<PointPair, 256> pattern = MakeUprightPattern();
  return pattern;
}

const TurnedPattern& TurnedPatterns() {
  static const TurnedPattern pattern = MakeTurnedPattern();
  return pattern;
}

}  // namespace tessera
