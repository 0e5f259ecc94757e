// FAMILY_fuzz CORPUS NUMBER reads the target's seeds, the inputs of a corpus file, and so many inputs made from them.
// One that a sanitizer or Expect() ends the program at is left in the file fuzz-input of the working folder.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "fuzz/fuzz_target.h"
#include "fuzz/mutations.h"

// Of the sanitizers; null without one.
extern "C" void __sanitizer_set_death_callback(void (*callback)()) __attribute__((weak));

namespace tessera {
namespace {

std::string input;  // that is being read

void KeepInput() {
  std::ofstream("fuzz-input", std::ios::binary) << input;
  std::fprintf(stderr, "the input is in the file fuzz-input\n");
}

void OnAbort(int /*signal*/) { KeepInput(); }

int ReadAll(const std::string& corpus_path, long number) {
  if (__sanitizer_set_death_callback != nullptr) __sanitizer_set_death_callback(KeepInput);
  std::signal(SIGABRT, OnAbort);
  std::vector<std::string> inputs = Seeds();
  const std::vector<std::string> corpus = ReadCorpus(corpus_path);
  inputs.insert(inputs.end(), corpus.begin(), corpus.end());
  for (const std::string& each : inputs) Read(input = each);
  Mutations mutations(inputs);
  for (long i = 0; i < number; ++i) Read(input = mutations.Next());
  std::printf("%zu seeds, %zu of the corpus, %ld made from them\n", inputs.size() - corpus.size(), corpus.size(),
              number);
  return corpus.empty() || number <= 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s CORPUS NUMBER\n", argv[0]);
    return 2;
  }
  return tessera::ReadAll(argv[1], std::atol(argv[2]));
}
