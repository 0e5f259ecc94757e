// The entry points that libFuzzer calls; FAMILY_fuzz --seeds FOLDER writes the target's seeds instead.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/errors.h"
#include "fuzz/fuzz_target.h"

namespace tessera {
namespace {

constexpr const char* kMemory = "/dev/shm";
constexpr size_t kMaxPieceBytes = 0xFFFF;

}  // namespace

uint8_t FuzzInput::TakeByte() {
  const std::string_view taken = Take(1);
  return taken.empty() ? uint8_t{0} : static_cast<uint8_t>(taken[0]);
}

std::string_view FuzzInput::TakePiece() {
  const size_t high = TakeByte(), low = TakeByte();
  return Take((high << 8) + low);
}

std::string_view FuzzInput::TakeRest() { return Take(rest_.size()); }

std::string_view FuzzInput::Take(size_t size) {
  const std::string_view taken = rest_.substr(0, size);
  rest_.remove_prefix(taken.size());
  return taken;
}

std::string Piece(std::string_view text) {
  const size_t size = std::min(text.size(), kMaxPieceBytes);
  const std::string length{static_cast<char>(size >> 8), static_cast<char>(size & 0xFF)};
  return length + std::string(text.substr(0, size));
}

FuzzFolder::FuzzFolder() {
  std::string pattern = std::string(kMemory) + "/tessera-fuzz-XXXXXX";
  path_ = mkdtemp(pattern.data());
}

FuzzFolder::~FuzzFolder() { std::filesystem::remove_all(path_); }

void FuzzFolder::Write(const std::string& name, std::string_view text) const {
  std::filesystem::create_directories(std::filesystem::path(path(name)).parent_path());
  std::ofstream(path(name), std::ios::binary) << text;
}

void ExpectSentence(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    Expect(error.what()[0] != '\0', "an error without a sentence");
  }
}

void Expect(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "fuzz target: %s\n", what);
  std::abort();
}

}  // namespace tessera

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc == 3 && std::string((*argv)[1]) == "--seeds") {
    std::filesystem::create_directories((*argv)[2]);
    int number = 0;
    for (const std::string& seed : tessera::Seeds()) {
      std::ofstream(std::string((*argv)[2]) + "/seed" + std::to_string(number++), std::ios::binary) << seed;
    }
    std::exit(number > 0 ? EXIT_SUCCESS : EXIT_FAILURE);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::Read({reinterpret_cast<const char*>(data), size});
  return 0;
}
