// Messages of every type, as they come from a bus: their tags, headers, parts and values, and packed tiles.
//
// Input: the number of a type, then messages as pieces.
#include "features/tile_packing.h"
#include "fuzz/fuzz_target.h"
#include "streams/authenticator.h"
#include "support/example_values.h"

namespace tessera {
namespace {

constexpr size_t kSeedBytes = 1380;
constexpr size_t kMaxSeedMessages = 3;

Bytes ToBytes(std::string_view text) { return Bytes(text.begin(), text.end()); }

// What was accepted can be sent on, and comes back the same.
template <class Value>
void ExpectRoundTrip(const Value& value) {
  ValueJoiner<Value> joiner;
  const Value* decoded = nullptr;
  for (const Bytes& message : EncodeValue(value, ExampleHeader(), kSeedBytes)) {
    const auto header = ReadHeader(message);
    Expect(header.has_value(), "an encoded message has no header");
    const auto result = joiner.Add(message, *header);
    Expect(result.has_value(), "a value that was accepted is refused when it is sent on");
    decoded = *result;
  }
  Expect(decoded != nullptr && AreSame(value, *decoded), "a value that was accepted does not come back the same");
}

// Visits are copied on their way, so they count through a pointer.
struct ReadType {
  int* number;  // of the type, counted down
  FuzzInput* input;

  template <class Value>
  void operator()() {
    if ((*number)-- != 0) return;
    ValueJoiner<Value> joiner;
    while (!input->is_empty()) {
      const Bytes message = ToBytes(input->TakePiece());
      const auto header = ReadHeader(message);
      if (!header) continue;
      const Result<const Value*> value = joiner.Add(message, *header);
      if (!value) {
        Expect(!value.error().sentence.empty(), "a refusal without a sentence");
      } else if (*value != nullptr) {
        ExpectRoundTrip(**value);
        if constexpr (std::is_same_v<Value, TileJob>) {
          TileJob job = **value;
          (void)UnpackTile(job);
        }
      }
    }
  }
};

struct CountTypes {
  int* number;
  template <class Value>
  void operator()() {
    ++*number;
  }
};

struct WriteSeeds {
  std::vector<std::string>* seeds;
  int* number;

  template <class Value>
  void operator()() {
    std::mt19937 generator(1);
    for (const int size : {0, 1, 1}) {
      std::string seed(1, static_cast<char>(*number));
      std::vector<Bytes> messages = EncodeValue(DrawValue<Value>(generator, size), ExampleHeader(), kSeedBytes);
      if (messages.size() > kMaxSeedMessages) messages.resize(kMaxSeedMessages);
      for (const Bytes& message : messages) {
        seed += Piece({reinterpret_cast<const char*>(message.data()), message.size()});
      }
      seeds->push_back(seed);
    }
    ++*number;
  }
};

int NumTypes() {
  int number = 0;
  ForEachValueType(CountTypes{&number});
  return number;
}

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  int number = 0;
  ForEachValueType(WriteSeeds{&seeds, &number});
  return seeds;
}

void Read(std::string_view text) {
  static const int num_types = NumTypes();
  static const Authenticator authenticator(Authenticator::Secret{7});
  FuzzInput input(text);
  int number = input.TakeByte() % num_types;
  (void)authenticator.Verify("POSE", ToBytes(text));
  ForEachValueType(ReadType{&number, &input});
}

}  // namespace tessera
