// Where the 256 tests of a descriptor look.
#pragma once

#include <array>
#include <cstdint>

namespace tessera {

struct PointPair {
  int8_t x1, y1, x2, y2;  // px, within kPatchRadiusPx of the keypoint
};

// The tests of an upright keypoint (its centroid lies in direction +x).
const std::array<PointPair, 256>& UprightPattern();

inline constexpr int kNumTurns = 64;       // angles for which the pattern is tabulated
inline constexpr int kPatternStride = 32;  // of the patch into which the offsets point

// Offsets y * kPatternStride + x into a patch whose keypoint stands at (15, 15), for the angle turn / 64 of a full
// turn: first point, second point of each test.
struct TurnedPattern {
  std::array<std::array<uint16_t, 512>, kNumTurns> offsets;
};
const TurnedPattern& TurnedPatterns();

}  // namespace tessera
