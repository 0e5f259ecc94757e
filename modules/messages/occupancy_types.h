// What is known of space (OCCUPANCY), in blocks of voxels.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/ids.h"
#include "core/image.h"

namespace tessera {

// What the scans say of one voxel.
enum class VoxelState : uint8_t {
  kUnknown = 0,   // no ray reached it
  kFree = 1,      // rays went through it
  kOccupied = 2,  // rays ended in it
};

// The states of kSide x kSide x kSide voxels. Voxel i of an axis is the interval [i, i + 1) * resolution of the world,
// and block b holds the voxels kSide * b .. kSide * b + kSide - 1.
struct OccupancyBlock {
  static constexpr int kSide = 16;
  static constexpr size_t kNumVoxels = size_t{kSide} * kSide * kSide;
  static constexpr size_t kPerByte = 4;  // two bits each, the first voxel lowest

  int32_t x = 0;
  int32_t y = 0;
  int32_t z = 0;
  // Voxel (x, y, z) of the block is number x + kSide * (y + kSide * z).
  std::array<uint8_t, kNumVoxels / kPerByte> states{};

  bool operator==(const OccupancyBlock&) const = default;

  VoxelState At(size_t voxel) const {
    return static_cast<VoxelState>((states[voxel / kPerByte] >> (2 * (voxel % kPerByte))) & 3);
  }
  void Set(size_t voxel, VoxelState state) {
    const auto shift = 2 * (voxel % kPerByte);
    uint8_t& byte = states[voxel / kPerByte];
    byte = static_cast<uint8_t>((byte & ~(3U << shift)) | (static_cast<unsigned>(state) << shift));
  }
  size_t NumOccupied() const {
    constexpr unsigned kOccupiedBits = 0xAA;  // of four voxels: no state has both bits
    size_t num = 0;
    for (const uint8_t four : states) num += static_cast<size_t>(std::popcount(four & kOccupiedBits));
    return num;
  }
};

// The blocks that changed since the last update; of a block that is told, all voxels.
struct OccupancyUpdate {
  int64_t number = 0;         // counts from 0
  double resolution = 0.0;    // edge of a voxel, m (mono: units of the map)
  bool is_whole = false;      // all blocks: those that are not told are unknown
  int64_t num_keyframes = 0;  // whose scans are in the map
  std::vector<OccupancyBlock> blocks;
  // Of the occupied voxels of all blocks, in their order; empty: the images are gray.
  std::vector<Rgb> colors;

  bool operator==(const OccupancyUpdate&) const = default;
};

// Somebody wants all blocks.
struct OccupancyRequest {
  int64_t num_asked = 0;  // how often it has asked before

  bool operator==(const OccupancyRequest&) const = default;
};

}  // namespace tessera
