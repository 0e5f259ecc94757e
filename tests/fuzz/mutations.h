// Inputs made from others, as libFuzzer makes them, but without a look at the ways that they take: always the same
// ones.
#pragma once

#include <random>
#include <string>
#include <utility>
#include <vector>

namespace tessera {

class Mutations {
 public:
  // `inputs`: at least one.
  explicit Mutations(std::vector<std::string> inputs) : inputs_(std::move(inputs)) {}
  // One of the inputs, changed in one to five places.
  std::string Next();

 private:
  void Change(std::string* text);
  size_t Draw(size_t end);  // below `end`; 0 if that is 0

  const std::vector<std::string> inputs_;
  std::mt19937 generator_{17};
};

}  // namespace tessera
