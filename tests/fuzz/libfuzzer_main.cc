// The entry points that libFuzzer calls. Instead of fuzzing,
//   FAMILY_fuzz --unpack FILE FOLDER writes the target's seeds, and the inputs of a corpus file, as files of a folder;
//   FAMILY_fuzz --pack FOLDER FILE makes that corpus file of a folder, of the shortest inputs as far as 32 kB go.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz/fuzz_target.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxCorpusBytes = 32'000;

void Unpack(const std::string& path, const std::string& folder) {
  fs::create_directories(folder);
  std::vector<std::string> inputs = Seeds();
  for (std::string& input : ReadCorpus(path)) inputs.push_back(std::move(input));
  for (size_t i = 0; i < inputs.size(); ++i) {
    std::ofstream(folder + "/input" + std::to_string(i), std::ios::binary) << inputs[i];
  }
}

void Pack(const std::string& folder, const std::string& path) {
  std::vector<std::string> inputs;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::ifstream file(entry.path(), std::ios::binary);
    inputs.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  std::sort(inputs.begin(), inputs.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  std::string text;
  for (const std::string& input : inputs) {
    if (text.size() + input.size() < kMaxCorpusBytes) text += Piece(input);
  }
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::vector<std::string> words(*argv, *argv + *argc);
  if (words.size() != 4) return 0;
  if (words[1] == "--unpack") tessera::Unpack(words[2], words[3]);
  if (words[1] == "--pack") tessera::Pack(words[2], words[3]);
  if (words[1] == "--unpack" || words[1] == "--pack") std::exit(EXIT_SUCCESS);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::Read({reinterpret_cast<const char*>(data), size});
  return 0;
}
