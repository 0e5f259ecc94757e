// OCCUPANCY, OCCUPANCY_REQUEST.
#include "messages/occupancy_types.h"
#include "tessera/occupancy_request_t.hpp"
#include "tessera/occupancy_t.hpp"
#include "wire/codec_impl.h"

namespace tessera {
namespace {

// Both bits of no voxel are set.
bool AreKnownStates(const OccupancyBlock& block) {
  constexpr unsigned kLowBits = 0x55;
  return std::none_of(block.states.begin(), block.states.end(),
                      [](uint8_t states) { return (states & (states >> 1) & kLowBits) != 0; });
}

size_t NumOccupied(const std::vector<OccupancyBlock>& blocks) {
  size_t num = 0;
  for (const OccupancyBlock& block : blocks) num += block.NumOccupied();
  return num;
}

}  // namespace

template <>
struct Layout<occupancy_block_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& block) {
    constexpr int32_t kNumBlocks = (1 << 16) / OccupancyBlock::kSide;  // of OctoMap's space, along an axis
    fields(message.x, block.x);
    fields(message.y, block.y);
    fields(message.z, block.z);
    for (const int32_t number : {block.x, block.y, block.z}) {
      fields.Check(number >= -kNumBlocks / 2 && number < kNumBlocks / 2, "a block lies out of space");
    }
    fields(message.states, block.states);
    fields.Check(AreKnownStates(block), "one of its voxels has a state that does not exist");
  }
};

template <>
struct Layout<occupancy_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& update) {
    fields.Key(message.number, update.number);
    fields(message.resolution, update.resolution);
    fields(message.is_whole, update.is_whole);
    fields.Count(message.num_keyframes, update.num_keyframes);
    fields.Check(update.number >= 0, "its number is negative");
    fields.Check(IsScale(update.resolution), "its resolution is out of range");
    fields.List(message.num_blocks, message.blocks, update.blocks);
    fields.List(message.num_colors, message.colors, update.colors);
    fields.CheckWhole([&] { return update.colors.empty() || update.colors.size() == NumOccupied(update.blocks); },
                      "some of its occupied voxels have a color and others none");
  }
};
TESSERA_CODEC(OccupancyUpdate, occupancy_t);

template <>
struct Layout<occupancy_request_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& request) {
    fields.Count(message.num_asked, request.num_asked);
  }
};
TESSERA_CODEC(OccupancyRequest, occupancy_request_t);

}  // namespace tessera
