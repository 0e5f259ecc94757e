#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

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

std::vector<std::string> ReadCorpus(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::string> inputs;
  for (FuzzInput input(text); !input.is_empty();) inputs.emplace_back(input.TakePiece());
  return inputs;
}

}  // namespace tessera
